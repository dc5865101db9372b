"""Times of a table that do not increase: rounded, of several shots, or of a few rows in a wrong place."""

import numpy as np
from numpy.typing import NDArray

from impactcell.measurements.columns.assignment import TURN_ROUND, more_digits, runs_backwards
from impactcell.measurements.table import MeasuredColumn, Table
from impactcell.records import Samples

FEWEST_STRAY, STRAY_SHARE = 3, 0.01
"""Rows up to which, or up to which share of all, those out of order are strays: a shot has more rows."""


def not_increasing(table: Table, column: MeasuredColumn, steps: Samples) -> str:
    """Tell times that go back, in a few rows or with each shot, from times that repeat, as rounded do."""
    if runs_backwards(steps):
        return f"{table.title}: column {column.name!r} (time) runs backwards; {TURN_ROUND}"
    goes_back = bool((steps < 0.0).any())
    rows = np.flatnonzero(steps < 0.0 if goes_back else steps == 0.0) + 1
    way_out = _way_back(table, column.values) if goes_back else more_digits(column.name)
    row = int(rows[0])
    return (
        f"{table.place(row)}: time does not increase: {column.values[row]:.9g} after "
        f"{column.values[row - 1]:.9g} ({rows.size} such rows); {way_out}"
    )


def _way_back(table: Table, time: Samples) -> str:
    stray = stray_rows(time)
    if not 0 < stray.size <= max(FEWEST_STRAY, STRAY_SHARE * len(time)):
        return "several shots in one file need a column that numbers them (--column shot=NAME)"
    where = f"line {int(table.lines[stray[0]])}" if table.lines is not None else f"row {int(stray[0]) + 1}"
    if stray.size == 1:
        return f"{where} is out of order: delete it, or sort the rows by their time"
    return f"{stray.size} rows are out of order, the first in {where}: delete them, or sort the rows by time"


def stray_rows(time: Samples) -> NDArray[np.intp]:
    """Give the rows without which the others are in order: late ones, or, where they are fewer, early ones.

    >>> stray_rows(np.array([0.0, 2.0, 1.0, 3.0])), stray_rows(np.array([0.0, 9.0, 1.0, 2.0]))
    (array([2]), array([1]))
    """
    late = np.flatnonzero(time < np.maximum.accumulate(time))
    early = np.flatnonzero(time > np.minimum.accumulate(time[::-1])[::-1])
    return late if late.size <= early.size else early
