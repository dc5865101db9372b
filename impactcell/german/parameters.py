"""What page and report call the parameters of plant and effects: words and a unit, in both languages."""

from typing import Final

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
    >>> parameter_words("", "damping_n_s_per_m", "de")
    ('Dämpfung', 'N s/m')
    """
    words, unit = PLANT.get(name, (name, "")) if not effect else _of_effect(effect, name)
    return words_of(words, language), unit


def _of_effect(effect: str, name: str) -> tuple[str, str]:
    known = LIBRARY.get(effect)
    units = {} if known is None else {parameter.name: parameter.unit for parameter in known.parameters}
    if name not in units:
        return name, ""
    if units[name] == "1":
        return name, ""
    *words, last = name.split("_")
    while words and last in UNIT_PARTS:
        *words, last = words
    return "_".join((*words, last)), units[name]
