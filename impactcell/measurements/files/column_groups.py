"""Rows of text in which several groups of columns go by times of their own and end where they will."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from impactcell.measurements.columns.recognition import WORD_MATCH, ColumnMeaning, name_score
from impactcell.measurements.files.cells import CHUNK_ROWS, LineFaults, numbers_of
from impactcell.measurements.files.dialect import split_cells
from impactcell.measurements.notation.moments import EPOCH
from impactcell.measurements.table import AGAIN, MeasuredColumn, Table, unique_names
from impactcell.records import Samples

TIME = "time"
"""Name of the times of each group, whatever the file calls them."""
TICKS_A_SECOND, TICKS_IN_1970 = 10_000_000, 116_444_736_000_000_000
"""Clock of Windows (FILETIME): steps of 100 ns, from 1601 on."""
LEAST_TICKS, MOST_TICKS = TICKS_IN_1970 - 2**63 // 100 + 1, TICKS_IN_1970 + 2**63 // 100 - 1
"""Counts of 1677 and 2262, where nanoseconds from 1970 end; what is less may be a time of any unit."""


@dataclass(frozen=True, slots=True)
class ColumnGroup:
    """Columns that were sampled at the same times.

    Attributes
    ----------
    place : str
        What faults call it; also the name of its table where the file has several.
    columns : tuple of int
        Places of its channels in a row.
    names : tuple of str
    units : tuple of str or None
    time : int or None
        Place of its times; None where they go by steps.
    time_unit : str
    first_s, step_s : float
        Its first time and their step [s], where no column holds them.
    begun : datetime64 or None
        Moment from which the times count.
    notes : tuple of str
    """

    place: str
    columns: tuple[int, ...]
    names: tuple[str, ...]
    units: tuple[str | None, ...]
    time: int | None = None
    time_unit: str = "s"
    first_s: float = 0.0
    step_s: float = 0.0
    begun: np.datetime64 | None = None
    notes: tuple[str, ...] = ()


class GroupedText(NamedTuple):
    """How such rows are written: what separates cells, decimal mark, words for lost values in lower case."""

    delimiter: str
    decimal: str
    lost: frozenset[str] = frozenset()


@dataclass(slots=True)
class _Parts:
    """What has been read of a group."""

    columns: list[list[Samples]]
    ticks: list[list[str]]
    lines: list[int]


def tables_of_groups(
    source: str,
    lines: Sequence[str],
    groups: Sequence[ColumnGroup],
    text: GroupedText,
    begin: int = 1,
) -> list[Table]:
    """Read rows of text into a table for each group.

    A row belongs to a group where it has a time of it, or where there are no times, any value. Rows that
    repeat time and values of the one before are left out, as an export makes them that fills up a slow group.

    Parameters
    ----------
    source : str
    lines : sequence of str
        Rows alone.
    groups : sequence of ColumnGroup
    text : GroupedText
    begin : int
        Number of the first of the lines.

    Raises
    ------
    MeasurementError
        Cells that are no numbers, by file and line.
    """
    faults = LineFaults(source)
    parts = [_Parts([[] for _ in (TIME, *group.columns)], [], []) for group in groups]
    for first in range(0, len(lines), CHUNK_ROWS):
        rows = [split_cells(line, text.delimiter) for line in lines[first : first + CHUNK_ROWS]]
        for group, read in zip(groups, parts, strict=True):
            _read(group, rows, begin + first, text, read, faults)
    faults.raise_any()
    return [
        _table(source, group, read, several=len(groups) > 1)
        for group, read in zip(groups, parts, strict=True)
        if read.lines
    ]


def _read(
    group: ColumnGroup,
    rows: Sequence[Sequence[str]],
    begin: int,
    text: GroupedText,
    read: _Parts,
    faults: LineFaults,
) -> None:
    own = (group.time,) if group.time is not None else group.columns
    present = [
        index for index, row in enumerate(rows) if any(place < len(row) and row[place] for place in own)
    ]
    if not present:
        return
    read.lines += [begin + index for index in present]
    places = group.columns if group.time is None else (group.time, *group.columns)
    stores = read.columns[1:] if group.time is None else read.columns
    names = group.names if group.time is None else (TIME, *group.names)
    for place, store, name in zip(places, stores, names, strict=True):
        cells = [rows[index][place] if place < len(rows[index]) else "" for index in present]
        if place == group.time and all(map(is_ticks, cells)):
            read.ticks.append(cells)
        numbered = [begin + index for index in present]
        store.append(numbers_of(cells, numbered, name, text.decimal, faults, text.lost))


def _table(source: str, group: ColumnGroup, read: _Parts, *, several: bool) -> Table:
    values = [np.concatenate(parts) if parts else np.empty(0) for parts in read.columns]
    lines = np.array(read.lines, dtype=np.int64)
    time = values[0].astype(np.float64)
    unit, begun = group.time_unit, group.begun
    if group.time is None:
        time = np.asarray(group.first_s + group.step_s * np.arange(len(lines)), dtype=np.float64)
    elif sum(map(len, read.ticks)) == len(lines):
        ticks = np.array([int(cell) for cells in read.ticks for cell in cells], dtype=np.int64)
        time, unit = np.asarray((ticks - ticks[0]) / TICKS_A_SECOND, dtype=np.float64), "s"
        begun = moment_of_ticks(int(ticks[0]))
    kept = np.ones(len(lines), dtype=bool)
    if group.time is not None:
        same = [np.diff(column) == 0.0 for column in (time, *values[1:])]
        kept[1:] = ~np.logical_and.reduce(same)
    names = unique_names([TIME, *group.names])
    columns = [MeasuredColumn(names[0], unit, time[kept], begun=begun)]
    columns += [
        MeasuredColumn(name, of, column[kept])
        for name, of, column in zip(names[1:], group.units, values[1:], strict=True)
        if np.isfinite(column).any()
    ]
    repeated = int(np.sum(~kept))
    notes = group.notes + ((f"{repeated} repeated rows left out",) if repeated else ())
    return Table(source, tuple(columns), group.place if several else "", notes=notes, lines=lines[kept])


def by_their_times(table: Table) -> tuple[Table, ...]:
    """Give the channels of a table by the times before them, where a column of times comes more than once.

    Pairs of time and value, as some loggers write them, may have rates and ends of their own. Where all times
    are the same, one of them is enough.
    """
    names = [AGAIN.sub("", column.name) for column in table.columns]
    times = [
        place
        for place, (column, name) in enumerate(zip(table.columns, names, strict=True))
        if column.text is None and name == names[0] and name_score(name, ColumnMeaning.TIME)[0] >= WORD_MATCH
    ]
    ends = [*times[1:], len(names)]
    if len(times) < 2 or any(end == place + 1 for place, end in zip(times, ends, strict=True)):
        return (table,)
    first = table.columns[0]
    others = [table.columns[place] for place in times[1:]]
    same = [np.array_equal(first.values, one.values, equal_nan=True) for one in others]
    if all(same) and {(one.unit, one.begun) for one in others} == {(first.unit, first.begun)}:
        kept = tuple(c for place, c in enumerate(table.columns) if place not in times[1:])
        return (replace(table, columns=kept),)
    made = []
    for place, end in zip(times, ends, strict=True):
        rows = np.flatnonzero(np.isfinite(table.columns[place].values))
        part = replace(table, columns=table.columns[place:end], name=f"times in column {place + 1}")
        made.append(part.rows(rows))
    return tuple(made)


def is_ticks(cell: str) -> bool:
    """Whether a cell is a count of Windows' clock."""
    return cell.isascii() and cell.isdigit() and len(cell) < 19 and LEAST_TICKS <= int(cell) <= MOST_TICKS


def moment_of_ticks(ticks: int) -> np.datetime64:
    """Give the moment of a count of Windows' clock, 100 ns each since 1601."""
    moment: np.datetime64 = EPOCH + np.timedelta64(100 * (ticks - TICKS_IN_1970), "ns")
    return moment
