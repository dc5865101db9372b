"""What an effect is called in English: its identifier in words, proper names with their capitals."""

import re
from typing import Final

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
    """
    words = identifier.replace("_", " ")
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
