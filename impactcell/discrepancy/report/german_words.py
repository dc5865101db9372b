"""What the report calls things in German: phases, channels, covariates, verdicts, effects and terms."""

from typing import Final

from impactcell.discrepancy.machine import LAW_PLACES
from impactcell.german.findings import (
    GERMAN_PHASES,
    GERMAN_QUANTITIES,
    GERMAN_STATES,
    GERMAN_TERMS,
    german_texts,
)
from impactcell.physics.effect_names import in_words

WORDS: Final = {
    **GERMAN_PHASES,
    **GERMAN_QUANTITIES,
    **GERMAN_STATES,
    "named": "benannt",
    "tied": "nicht zu unterscheiden",
    "no_gap": "keine Abweichung",
    "unknown": "unbekannt",
    "untested": "nicht geprüft",
    "tap": "Stoß",
    "driven": "angetrieben",
    "dwell": "Ruhezeit",
    "start": "Anfangslage",
    "initial_speed": "Anfangsgeschwindigkeit",
    "order": "Reihenfolge",
    "shots": "Stöße",
    "blocks": "Blöcke",
    "block": "Block",
    "stated": "angegeben",
    "estimated": "geschätzt",
}
"""Phases, channels, covariates and verdicts, by their names in the workflow."""


def phrase(identifier: str) -> str:
    """Name an effect, a phase, a covariate or a verdict."""
    if (german := german_texts(identifier)) is not None:
        return german.name
    return WORDS.get(identifier, in_words(identifier))


def term_name(name: str) -> str:
    """Name a term of a machine, with its column where it is of one; the rest as `phrase` does.

    >>> term_name("covariate_friction(pressure_bar)"), term_name("viscous_friction")
    ('Reibung je Einflussgröße (pressure_bar)', 'Viskose Reibung')
    >>> term_name("law_of_friction_over_load(u^2)")
    'Gesetz: Reibung über der Last (u^2)'
    """
    identifier, _, column = name.partition("(")
    said = GERMAN_TERMS.get(identifier) or phrase(identifier)
    if identifier in LAW_PLACES:
        said = f"Gesetz: {GERMAN_TERMS[LAW_PLACES[identifier]]}"
    return f"{said} ({column}" if column else said
