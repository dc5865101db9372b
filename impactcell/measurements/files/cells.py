"""Cells of text as numbers; those that are none are told with their lines, the first of them in full."""

from collections import Counter
from collections.abc import Sequence
from collections.abc import Set as AbstractSet

import numpy as np

from impactcell.errors import MeasurementError
from impactcell.measurements.faults import MAX_FAULTS_TOLD
from impactcell.measurements.notation.numbers import parse_number, plain_numbers
from impactcell.records import Samples

LONGEST_WORD = 20
"""Signs of the longest word that a recorder may write for a value that was lost."""
CHUNK_ROWS = 20_000
"""Rows whose cells are held as text at a time: some 10 MB."""


class LineFaults:
    """The first faults of a text file, and how many more there are."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._told: dict[str, str] = {}
        self._alike: Counter[str] = Counter()
        self._count = 0

    def add(self, line: int, message: str, kind: str = "") -> None:
        """Tell what is wrong in a line; of faults of one kind the first alone, with how many there are."""
        self._count += 1
        told = f"{self._source}:{line}: {message}"
        kind = kind or told
        if kind in self._told or len(self._told) < MAX_FAULTS_TOLD:
            self._told.setdefault(kind, told)
            self._alike[kind] += 1

    def raise_any(self) -> None:
        """Raise `MeasurementError` with what has been told, if anything."""
        if self._told:
            rest = self._count - self._alike.total()
            more = [f"{self._source}: and {rest} more faults"] if rest else []
            told = [self._with_count(kind, first) for kind, first in self._told.items()]
            raise MeasurementError("\n".join(told + more))

    def _with_count(self, kind: str, first: str) -> str:
        others = self._alike[kind] - 1
        return f"{first} (and {others} more like this)" if others else first


def numbers_of(
    cells: list[str],
    lines: Sequence[int],
    name: str,
    decimal: str,
    faults: LineFaults,
    lost: AbstractSet[str] | None = None,
) -> Samples:
    """Give the numbers of the cells of a column, nan where one is empty or, with a fault, no number.

    Parameters
    ----------
    lost : set of str or None
        Words, in lower case, that were said to stand for no value too; None where none can be said.
    """
    if lost:
        cells = ["" if cell.strip().lower() in lost else cell for cell in cells]
    values = plain_numbers(cells, decimal)
    if values is None:
        values = np.full(len(cells), np.nan)
        for row, cell in enumerate(cells):
            value = parse_number(cell, decimal)
            if value is None:
                word = "" if any(map(str.isdigit, cell)) else cell.strip().lower()
                way_out = _lost_words(word) if lost is not None else ""
                faults.add(lines[row], f"column {name!r}: {_no_number(cell, decimal)}{way_out}", word)
            else:
                values[row] = value
    for row in np.flatnonzero(np.isinf(values)).tolist():
        way_out = _lost_words(cells[row].strip().lower()) if lost is not None else ""
        faults.add(
            lines[row],
            f"column {name!r} is infinite; write the number, or leave the cell empty where there is none"
            f"{way_out}",
            "infinite",
        )
    return values


def _no_number(cell: str, decimal: str) -> str:
    """Say that a cell is no number, and the ways out."""
    mark, other = ("point", "comma") if decimal == "." else ("comma", "point")
    is_one = parse_number(cell, "," if decimal == "." else ".") is not None
    way = f"say --decimal {other} if that is its mark, " if is_one else ""
    return f"{cell[:40]!r} is not a number with decimal {mark}; {way}correct the cell, or leave it empty"


def _lost_words(word: str) -> str:
    """Say how a word is said to stand for a value that was lost."""
    if not 0 < len(word) <= LONGEST_WORD:
        return ""
    return f", or say that it stands for none with `lost: [{word!r}]` in a --mapping file"
