"""Marks in the numbers of a text file that separate thousands, where they were taken for decimal ones."""

import re
from collections.abc import Sequence

from impactcell.errors import MeasurementError
from impactcell.measurements.notation.numbers import is_missing

_OF_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}([.,])\d{3}(?:\1\d{3})*")
"""A number whose marks may all separate thousands."""
_BELOW_THOUSAND = re.compile(r"[+-]?\d{1,3}")
"""A whole number in which no thousand is to be separated."""


class ThousandsWatch:
    """Looks at the cells of a table for columns whose marks look as if they separated thousands.

    In such a column each marked number has three digits behind the mark, and whole numbers are unmarked up
    to 999; decimals have a zero to the left of the mark somewhere, or fewer digits behind it. One mark that
    is decimal tells it of the whole file.
    """

    def __init__(self, decimal: str) -> None:
        self._decimal = decimal
        self._is_decimal = False
        self._marked: dict[int, str] = {}
        self._unmarked: set[int] = set()
        self._without: set[int] = set()

    def look(self, place: int, cells: Sequence[str]) -> None:
        """Look at cells of one column."""
        for cell in () if self._is_decimal else cells:
            if self._decimal in cell:
                if _OF_THOUSANDS.fullmatch(cell.replace("−", "-")) is None:
                    self._is_decimal = True
                    return
                self._marked.setdefault(place, cell)
            elif _BELOW_THOUSAND.fullmatch(cell.replace("−", "-")):
                self._unmarked.add(place)
            elif not is_missing(cell):
                self._without.add(place)

    def refuse(self, source: str, names: Sequence[str]) -> None:
        """Refuse a file in which it is not known whether a mark separates thousands.

        Raises
        ------
        MeasurementError
            With the first such column.
        """
        doubted = self._unmarked - self._without
        for place, cell in () if self._is_decimal else self._marked.items():
            if place in doubted:
                name = names[place] or f"column {place + 1}"
                mark, other = ("point", "comma") if self._decimal == "." else ("comma", "point")
                raise MeasurementError(
                    f"{source}: column {name!r} has numbers like {cell!r} beside whole ones up to 999, which "
                    f"may be thousands; say --decimal {other} if they are, --decimal {mark} if not"
                )
