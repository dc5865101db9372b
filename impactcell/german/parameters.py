"""What page and report call the parameters of plant and effects: words and a unit, in both languages."""

from typing import Final

from impactcell.german.findings import GERMAN_TERMS
from impactcell.physics.effect_names import in_words
from impactcell.physics.effects import LIBRARY

PLANT: Final = {
    "stiffness_n_per_m": ("stiffness", "N/m"),
    "damping_n_s_per_m": ("damping", "N s/m"),
    "mu_s": ("µs", ""),
    "mu_k": ("µk", ""),
    "ratio": ("µs/µk", ""),
}
"""Words and unit of the plant's own parameters."""
UNIT_PARTS: Final = {"n", "m", "m2", "s", "s2", "rad", "per"}
"""What the unit at the end of a parameter's name is made of."""
MACHINE_UNITS: Final = {
    "n": "N",
    "n_s_per_m": "N s/m",
    "n_s2_per_m2": "N s²/m²",
    "n_per_m": "N/m",
    "n_per_m3": "N/m³",
    "n_per_unit": "N/u",
    "n_m": "N m",
    "n_m_s_per_rad": "N m s/rad",
    "n_m_s2_per_rad2": "N m s²/rad²",
    "n_m_per_rad": "N m/rad",
    "n_m_per_rad3": "N m/rad³",
    "n_m_per_unit": "N m/u",
    "m": "m",
    "m_per_s": "m/s",
    "rad": "rad",
    "rad_per_s": "rad/s",
    "s": "s",
}
"""Units of a machine's parameters, of a translation and of a rotation, by how they end a name."""
GERMAN: Final = {
    "amplitude": "Amplitude",
    "asymmetric coefficient": "richtungsabhängiger Koeffizient",
    "centre": "Mitte",
    "cosine amplitude": "Kosinusamplitude",
    "cubic stiffness": "kubische Steifigkeit",
    "damping": "Dämpfung",
    "delay": "Verzögerung",
    "drag coefficient": "Widerstandsbeiwert",
    "exponent": "Exponent",
    "force": "Kraft",
    "force gain": "Skalenfehler der Kraft",
    "force offset": "Nullpunktfehler der Kraft",
    "force per covariate": "Kraft je Einflussgröße",
    "friction": "Reibung",
    "friction gradient": "Gradient der Reibung",
    "friction increase": "Zunahme der Reibung",
    "friction per covariate": "Reibung je Einflussgröße",
    "gradient": "Gradient",
    "gravity torque": "Schweremoment",
    "increase per decade": "Zunahme je Dekade",
    "inertia": "Trägheit",
    "limit": "Grenze",
    "load coefficient": "Lastbeiwert",
    "offset": "Versatz",
    "period": "Periode",
    "phase": "Phase",
    "position": "Position",
    "position eccentricity cosine": "Exzentrizität (Kosinus)",
    "position eccentricity sine": "Exzentrizität (Sinus)",
    "position offset": "Nullpunktfehler der Position",
    "presliding length": "Vorgleitlänge",
    "ramp time": "Anlaufzeit",
    "range": "Reichweite",
    "reference": "Bezugswert",
    "relative amplitude": "relative Amplitude",
    "relative change": "relative Änderung",
    "relative error": "relativer Fehler",
    "scale": "Maßstab",
    "sine amplitude": "Sinusamplitude",
    "speed loss": "Geschwindigkeitsverlust",
    "stiffness": "Steifigkeit",
    "stribeck velocity": "Stribeck-Geschwindigkeit",
    "tilt": "Neigung",
    "time constant": "Zeitkonstante",
    "viscous coefficient": "viskoser Koeffizient",
    "width": "Breite",
}
"""By the words in English; what is not here stays English."""


def words_of(name: str, language: str) -> str:
    """Words of a parameter's name without its unit."""
    stem, _, number = name.rpartition("_")
    if stem and number.isdigit():
        return f"{words_of(stem, language)} {number}"
    return GERMAN.get(name.replace("_", " "), in_words(name)) if language == "de" else in_words(name)


def parameter_words(effect: str, name: str, language: str) -> tuple[str, str]:
    """Give words and unit of a parameter, of the plant where `effect` is empty.

    One of an effect that the library does not have keeps its whole name: nobody says what of it is a unit.

    >>> parameter_words("stribeck_friction", "stribeck_velocity_m_s", "en")
    ('Stribeck velocity', 'm/s')
    >>> parameter_words("viscous_friction", "viscous_coefficient_n_m_s_per_rad", "de")
    ('viskoser Koeffizient', 'N m s/rad')
    >>> parameter_words("", "damping_n_s_per_m", "de")
    ('Dämpfung', 'N s/m')
    """
    words, unit = PLANT.get(name, (name, "")) if not effect else _of_effect(effect, name)
    return words_of(words, language), unit


def without_unit(name: str) -> tuple[str, str]:
    """Part a machine's parameter from the unit at its end; empty where it has none.

    >>> without_unit("drag_coefficient_n_m_s2_per_rad2"), without_unit("load_coefficient")
    (('drag_coefficient', 'N m s²/rad²'), ('load_coefficient', ''))
    """
    ends = (end for end in MACHINE_UNITS if name.endswith(f"_{end}"))
    end = max(ends, key=len, default="")
    return name.removesuffix(f"_{end}"), MACHINE_UNITS.get(end, "")


def _of_effect(effect: str, name: str) -> tuple[str, str]:
    known = LIBRARY.get(effect)
    units = {} if known is None else {parameter.name: parameter.unit for parameter in known.parameters}
    if name not in units:
        return without_unit(name) if known or effect in GERMAN_TERMS else (name, "")
    if units[name] == "1":
        return name, ""
    *words, last = name.split("_")
    while words and last in UNIT_PARTS:
        *words, last = words
    return "_".join((*words, last)), units[name]
