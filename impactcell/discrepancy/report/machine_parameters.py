"""What the page of a machine calls its parameters: words and a unit, by their names in `result.json`."""

from collections.abc import Iterable, Mapping
from typing import Any, Final

from impactcell.campaign import Coordinate
from impactcell.discrepancy.machine import MachineFinding
from impactcell.german.parameters import without_unit, words_of

SYMBOLS: Final = {
    Coordinate.TRANSLATION: {"force": "N", "F": "n", "q": "m"},
    Coordinate.ROTATION: {"force": "N m", "F": "n_m", "q": "rad"},
}
"""Units of force and coordinate, as they are shown and as they end a parameter's name."""
SLUGS: Final = {
    "{F}": "{F}",
    "{F} s/{q}": "{F}_s_per_{q}",
    "{F} s²/{q}²": "{F}_s2_per_{q}2",
    "{F}/{q}": "{F}_per_{q}",
    "{F}/{q}³": "{F}_per_{q}3",
    "{F}/u": "{F}_per_unit",
    "1": "",
}
"""How a unit ends a parameter's name."""
NUISANCE_UNITS: Final = {
    "force_offset": "{F}",
    "gravity_torque": "{F}",
    "position_offset": "{q}",
    "position_eccentricity_cosine": "{q}",
    "position_eccentricity_sine": "{q}",
}
"""Units of those whose names have none."""
INERTIA_UNITS: Final = {Coordinate.TRANSLATION: "kg", Coordinate.ROTATION: "kg m²"}


def parameter_name(name: str, unit: str, coordinate: Coordinate) -> str:
    """Name of a strength with its SI unit, as `drag_coefficient_n_s2_per_m2`."""
    slug = SLUGS[unit].format(F=SYMBOLS[coordinate]["F"], q=SYMBOLS[coordinate]["q"])
    return f"{name}_{slug}" if slug else name


def law_covariates(finding: MachineFinding) -> dict[str, str]:
    """Name what a proposed law is a function of, with units; nothing where none is proposed."""
    q, force = SYMBOLS[finding.base.coordinate]["q"], SYMBOLS[finding.base.coordinate]["force"]
    units = {"speed": f"{q}/s", "velocity": f"{q}/s", "load": force, "position": q}
    return {} if finding.law is None else {name: units[name] for name in finding.law.tested}


def machine_parameter_words(name: str, coordinate: Coordinate, language: str) -> tuple[str, str]:
    """Give words and unit of a parameter.

    >>> machine_parameter_words("drag_coefficient_n_m_s2_per_rad2", Coordinate.ROTATION, "de")
    ('Widerstandsbeiwert', 'N m s²/rad²')
    >>> machine_parameter_words("inertia", Coordinate.TRANSLATION, "en")
    ('inertia', 'kg')
    """
    symbols = SYMBOLS[coordinate]
    if name == "inertia":
        return words_of(name, language), INERTIA_UNITS[coordinate]
    if name in NUISANCE_UNITS:
        return words_of(name, language), NUISANCE_UNITS[name].format(F=symbols["force"], q=symbols["q"])
    stem, unit = without_unit(name)
    return words_of(stem, language), unit


def parameter_rows(
    owners: Iterable[tuple[str, Mapping[str, Any]]], coordinate: Coordinate, language: str
) -> list[dict[str, Any]]:
    """Rows of a table of parameters: term, name, words, unit, and what `result.json` says of it.

    Parameters
    ----------
    owners : iterable of (str, mapping)
        Term, empty for the base model, and its parameters by name; `term.parameter` is that of a term.
    """
    rows = []
    for term, parameters in owners:
        for name, item in parameters.items():
            *of, own = name.rsplit(".", 1)
            words, unit = machine_parameter_words(own, coordinate, language)
            told = item.get("unit", unit)
            said = {"name": own, "words": words, "unit": "" if told == "1" else told}
            rows.append({"term": of[0] if of else term} | item | said)
    return rows
