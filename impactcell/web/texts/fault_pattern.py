"""A fault as `impactcell import` says it, and as the page does."""

from typing import Final, NamedTuple

PLACE: Final = r"(?P<place>(?:.+?: )?)"
COLUMN: Final = r"column (['\"])(?P<column>.+?)\2"
"""A column by its name, as Python quotes it; the quote is the group behind that of the place."""


class FaultPattern(NamedTuple):
    """A fault as a pattern, and what the page says of it with the groups of the pattern."""

    pattern: str
    english: str
    german: str
