"""What an effect is called in English: its identifier in words, proper names with their capitals."""

import re
from typing import Final

COLUMN_PREFIX: Final = "free_friction_over_column_"
"""How identifiers of free-form terms over a column of `shots.csv` begin; behind it stand the column's letters
and a check of its name."""
PROPER: Final = {
    "hertz": "Hertz",
    "hunt crossley": "Hunt-Crossley",
    "stribeck": "Stribeck",
    "coulomb": "Coulomb",
}
"""Who an effect is named after, as an identifier has it."""


def in_words(identifier: str) -> str:
    """Say an identifier within a sentence.

    >>> in_words("hunt_crossley_damping"), in_words("stribeck_velocity"), in_words("surface_tilt")
    ('Hunt-Crossley damping', 'Stribeck velocity', 'surface tilt')

    Of a function of a column of `shots.csv` the letters of the column are told.

    >>> in_words("free_friction_over_column_oil_temperature_a3f09b")
    'friction over column oil_temperature'
    """
    over_column = re.fullmatch(rf"{COLUMN_PREFIX}(\w+)_[0-9a-f]{{6}}", identifier)
    words = f"friction over column {over_column[1]}" if over_column else identifier.replace("_", " ")
    for plain, proper in PROPER.items():
        words = re.sub(rf"\b{plain}\b", proper, words)
    return words


def as_title(words: str) -> str:
    """Write words as those that a line begins with; capitals within them stay.

    >>> as_title("Hunt-Crossley damping"), as_title("surface tilt")
    ('Hunt-Crossley damping', 'Surface tilt')
    """
    return words[:1].upper() + words[1:]


def identifier_of(words: str) -> str:
    """Give the identifier that was said.

    >>> identifier_of("Hunt-Crossley damping")
    'hunt_crossley_damping'
    """
    return re.sub("[ -]", "_", words).lower()
