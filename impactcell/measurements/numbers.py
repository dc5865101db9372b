"""Numbers as text: decimal comma or point, thousands separators, signs for a value that is missing.

Which mark a file uses is told from the file itself, by `dialect`.
"""

import math
import re
from functools import cache

MISSING = frozenset(
    ("", "-", "--", "---", "nan", "na", "n/a", "#n/a", "#nv",
     "null", "none", "nil", "1.#qnan", "-1.#ind", "1.#ind")
)  # fmt: skip
"""Cells, in lower case, that stand for no value."""
_SPACES = "\u00a0\u202f\u2009"
"""Spaces that do not break a line: nothing but separators of thousands."""


@cache
def _patterns(decimal: str) -> tuple[re.Pattern[str], re.Pattern[str]]:
    mark = re.escape(decimal)
    separators = "[" + re.escape("".join(sign for sign in ".,'’ " + _SPACES if sign != decimal)) + "]"
    tail = rf"(?:{mark}[0-9]*)?(?:[eEdD][+-]?[0-9]+)?"
    plain = rf"[+-]?(?:[0-9]+{tail}|{mark}[0-9]+(?:[eEdD][+-]?[0-9]+)?)"
    grouped = rf"[+-]?[0-9]{{1,3}}(?:({separators})[0-9]{{3}})(?:\1[0-9]{{3}})*{tail}"
    return re.compile(plain), re.compile(grouped)


def is_missing(cell: str) -> bool:
    """Whether a cell stands for no value."""
    return cell.strip().lower() in MISSING


def parse_number(cell: str, decimal: str = ".") -> float | None:
    """Give the number of a cell; None where it is none, nan where it says that there is none.

    Examples
    --------
    >>> parse_number("1.234,5", ","), parse_number("−2"), parse_number("1,5"), parse_number("NaN")
    (1234.5, -2.0, None, nan)
    """
    text = cell.strip().replace("−", "-")
    plain, grouped = _patterns(decimal)
    if plain.fullmatch(text):
        return float(text.replace(decimal, ".").replace("d", "e").replace("D", "e"))
    if is_missing(text):
        return math.nan
    if grouped.fullmatch(text):
        digits = "".join(sign for sign in text if sign in "0123456789+-eEdD" or sign == decimal)
        return float(digits.replace(decimal, ".").replace("d", "e").replace("D", "e"))
    return None


def is_grouped(cell: str, decimal: str) -> bool:
    """Whether a cell is a number only because thousands are separated in it."""
    text = cell.strip()
    plain, grouped = _patterns(decimal)
    return plain.fullmatch(text) is None and grouped.fullmatch(text) is not None
