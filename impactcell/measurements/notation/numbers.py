"""Numbers as text: decimal comma or point, thousands separators, signs for a value that is missing.

Which mark a file uses is told from the file itself, by `dialect`.
"""

import math
import re
from functools import cache

import numpy as np

from impactcell.records import Samples

MISSING = frozenset(
    ("", "-", "--", "---", "nan", "na", "n/a", "#n/a", "#nv",
     "null", "none", "nil", "1.#qnan", "-1.#ind", "1.#ind")
)  # fmt: skip
"""Cells, in lower case, that stand for no value."""
_SPACES = "\u00a0\u202f\u2009"
"""Spaces that do not break a line: nothing but separators of thousands."""


_STATED = re.compile(r"([+-]?[0-9.,'’]+(?:[eE][+-]?[0-9]+)?)\s*(.*)")
"""A number, and whatever follows it."""
_ONE_SEPARATOR = re.compile(r"([+-]?[1-9][0-9]{0,2})([.,])([0-9]{3})((?:[eE][+-]?[0-9]+)?)")
"""A number whose one separator may be of thousands or of decimals."""
LARGEST_WHOLE = 2.0**53
"""Whole number beyond which not every one has a double."""


@cache
def _patterns(decimal: str) -> tuple[re.Pattern[str], re.Pattern[str]]:
    mark = re.escape(decimal)
    separators = "[" + re.escape("".join(sign for sign in ".,'’ " + _SPACES if sign != decimal)) + "]"
    tail = rf"(?:{mark}[0-9]*)?(?:[eEdD][+-]?[0-9]+)?"
    plain = rf"[+-]?(?:[0-9]+{tail}|{mark}[0-9]+(?:[eEdD][+-]?[0-9]+)?)"
    grouped = rf"[+-]?[1-9][0-9]{{0,2}}(?:({separators})[0-9]{{3}})(?:\1[0-9]{{3}})*{tail}"
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


def number_text(value: float) -> str:
    """Write a number that names something, as a batch or a shot, so that no other is written alike.

    Examples
    --------
    >>> number_text(20240131.0), number_text(0.1), number_text(7.0)
    ('20240131', '0.1', '7')
    """
    return f"{value:.0f}" if value.is_integer() and abs(value) < LARGEST_WHOLE else f"{value:.15g}"


def split_stated(text: str, decimal: str) -> tuple[float | None, str]:
    """Take the number that a text begins with off what follows it; None where it begins with none.

    In the file's decimal mark, or the other where that fails.

    Examples
    --------
    >>> split_stated("3.000 mm/min", ","), split_stated("18.9kg", ","), split_stated("0.050 m/s", ",")
    ((3000.0, 'mm/min'), (18.9, 'kg'), (0.05, 'm/s'))
    """
    match = _STATED.fullmatch(text.strip().replace("−", "-"))
    if match is None:
        return None, text
    value = parse_number(match[1], decimal)
    if value is None:
        value = parse_number(match[1], "," if decimal == "." else ".")
    return value, match[2]


def doubt_of_line(key: str, text: str, decimal: str) -> str:
    """Say what a line may say where one separator may be of thousands or of decimals; empty where none may.

    Who writes a line need not write numbers as whoever writes the table.

    Examples
    --------
    >>> doubt_of_line("Masse", "12.600 kg", ","), doubt_of_line("Masse", "12,600 kg", ",")
    ("the line 'Masse: 12.600 kg' may say 12,6 or 12600", '')
    """
    match = _STATED.fullmatch(text.strip().replace("−", "-"))
    parts = _ONE_SEPARATOR.fullmatch(match[1]) if match else None
    if parts is None or parts[2] == decimal:
        return ""
    whole, _, fraction, power = parts.groups()
    small = f"{whole}{decimal}{fraction}".rstrip("0").rstrip(decimal)
    return f"the line {f'{key}: {text}'!r} may say {small}{power} or {whole}{fraction}{power}"


def is_grouped(cell: str, decimal: str) -> bool:
    """Whether a cell is a number only because thousands are separated in it."""
    text = cell.strip()
    plain, grouped = _patterns(decimal)
    return plain.fullmatch(text) is None and grouped.fullmatch(text) is not None


def plain_numbers(cells: list[str], decimal: str) -> Samples | None:
    """Numbers that Python reads as they are, but for the decimal mark; None where one cell is another."""
    if any("_" in cell for cell in cells):
        return None
    if decimal == ",":
        cells = [cell.replace(".", "x").replace(",", ".") for cell in cells]
    try:
        return np.fromiter(map(float, cells), dtype=np.float64, count=len(cells))
    except ValueError:
        return None
