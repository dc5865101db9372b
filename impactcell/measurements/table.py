"""What a measurement file holds, before anybody says what it means."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from impactcell.records import Samples

Lines = NDArray[np.int64]
"""Line of each row of a table, or its index."""


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredColumn:
    """One column of a table.

    Attributes
    ----------
    name : str
        As the file calls it, without its unit.
    unit : str or None
        As the file writes it; None where it says nothing.
    values : ndarray, shape (n,)
        In that unit; nan where there is no number.
    text : tuple of str or None
        The cells, where they are not numbers.
    begun : datetime64 or None
        Moment from which its seconds count, where the file says it; a time of day alone is of 1 January 1970.
    """

    name: str
    unit: str | None
    values: Samples
    text: tuple[str, ...] | None = None
    begun: np.datetime64 | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Columns of equal length from one file.

    Attributes
    ----------
    source : str
        The file, as faults name it.
    columns : tuple of MeasuredColumn
    name : str
        Of the sheet, group or channel group; empty where the file is one table.
    attributes : mapping
        What the file says beside its columns: lines before the table, properties of groups.
    notes : tuple of str
        How it was read: dialect, header, what was left out.
    lines : Lines or None
        Line of each row, counted from 1; None where the file has no lines.
    decimal : str
        Decimal mark of numbers that the file writes as text.
    encoding : str
        In which a text file was read that is no UTF-8 and does not say; empty for all others.
    recording : str
        What its channels were recorded together with, where that is more than its file.
    constant_as : str
        How a file of its kind says what is constant in a record, by the example of the velocity.
    """

    source: str
    columns: tuple[MeasuredColumn, ...]
    name: str = ""
    attributes: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    lines: Lines | None = None
    decimal: str = "."
    encoding: str = ""
    recording: str = ""
    constant_as: str = "'velocity: 3000 mm/min' in a line above the table"

    @property
    def recorded_in(self) -> str:
        """File, or files, whose channels were recorded together."""
        return self.recording or self.source

    @property
    def title(self) -> str:
        """File, and where it has several tables which one."""
        return f"{self.source}: {self.name}" if self.name else self.source

    def __len__(self) -> int:
        return len(self.columns[0].values) if self.columns else 0

    def column(self, name: str) -> MeasuredColumn | None:
        """Give the column of this name, None where there is none."""
        return next((column for column in self.columns if column.name == name), None)

    def rows(self, rows: NDArray[np.intp]) -> "Table":
        """Give these rows alone."""
        columns = tuple(
            replace(
                column,
                values=column.values[rows],
                text=None if column.text is None else tuple(column.text[row] for row in rows),
            )
            for column in self.columns
        )
        return replace(self, columns=columns, lines=None if self.lines is None else self.lines[rows])

    def place(self, row: int) -> str:
        """Where a row is found: `file:line`, or `file: row n` counted from 1."""
        if self.lines is not None:
            return f"{self.source}:{int(self.lines[row])}"
        return f"{self.title}: row {row + 1}"


AGAIN = re.compile(r" \(\d+\)$")
"""What stands behind a name that was there before."""


def unique_names(names: list[str]) -> list[str]:
    """Names of columns, with ` (2)` and so on behind those that appear again, `column n` for empty ones.

    Examples
    --------
    >>> unique_names(["F", "F", ""])
    ['F', 'F (2)', 'column 3']
    """
    given: list[str] = []
    for place, name in enumerate(names, 1):
        base = name or f"column {place}"
        candidate, count = base, 1
        while candidate in given:
            count += 1
            candidate = f"{base} ({count})"
        given.append(candidate)
    return given
