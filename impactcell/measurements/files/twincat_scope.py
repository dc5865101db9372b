"""Text that TwinCAT Scope exports: channels in groups behind their times, each with its own sampling time.

Beckhoff, "TE13xx TwinCAT 3 Scope View", chapter on the export to CSV. The header is as long as was chosen at
the export; its rows begin anew, with their own name, where a column of times stands below.
"""

import re
from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace

import numpy as np

from impactcell.errors import MeasurementError
from impactcell.measurements.files.column_groups import (
    ColumnGroup,
    GroupedText,
    is_ticks,
    moment_of_ticks,
    tables_of_groups,
)
from impactcell.measurements.files.dialect import Dialect, split_cells
from impactcell.measurements.files.limits import Limits
from impactcell.measurements.notation.numbers import is_missing, parse_number
from impactcell.measurements.table import AGAIN, MeasuredColumn, Table

BEGINS = re.compile(r'"?Name"?([\t;,:| ])')
"""First line: the word, and what separates the cells of the file."""
SPACE = " "
"""Separates cells, and is in the names of channels as well."""
STARTS = re.compile(r'"?Start ?time', re.IGNORECASE)
HEAD_LINES = 12
"""Lines among which the moment of the begin stands."""
NO_UNIT = "(None)"
END = "EOF"


def is_scope_export(lines: Sequence[str]) -> bool:
    """Whether lines are of such a file."""
    return BEGINS.match(lines[0]) is not None and any(map(STARTS.match, lines[1:HEAD_LINES]))


def read_scope_export(source: str, lines: Sequence[str], limits: Limits, given: Dialect) -> tuple[Table, ...]:
    """Read each group of channels into a table.

    Parameters
    ----------
    source : str
    lines : sequence of str
    limits : Limits
    given : Dialect
        Its decimal mark, where the file is not to tell, and words for lost values.

    Raises
    ------
    MeasurementError
        There are no rows or no times, or cells are no numbers, by file and line.
    """
    found = BEGINS.match(lines[0])
    delimiter = "\t" if found is None else found[1]
    if delimiter == SPACE:
        raise MeasurementError(
            f"{source}:1: its cells are separated by spaces, as the words of a name are; export it with tabs"
        )
    begun = _begun(lines, delimiter)
    top = next(
        (row for row in range(2, len(lines)) if BEGINS.match(lines[row]) and not lines[row - 1].strip()), None
    )
    if top is None:
        raise MeasurementError(f"{source}: has no row of names below its begin; export it with its header")
    first = next((row for row in range(top, len(lines)) if _is_row(lines[row], delimiter, given.lost)), None)
    if first is None:
        raise MeasurementError(f"{source}: holds no samples")
    last = len(lines) - (lines[-1].strip().strip('"') == END)
    header = [_cells(line, delimiter) for line in lines[top:first] if line.strip(delimiter + " ")]
    groups = _groups(header, begun)
    rows = lines[first:last]
    width = len(split_cells(rows[0], delimiter))
    named = sum(1 + len(group.columns) for group in groups)
    if width != named:
        raise MeasurementError(
            f"{source}:{first + 1}: {width} cells where the header names {named} columns; export it with a "
            f"time for each sampling time (Timelines), and tabs between its cells"
        )
    limits.check_shape(source, len(rows), named)
    mark = given.decimal or ("." if delimiter == "," or not _has_decimal_comma(rows) else ",")
    tables = tables_of_groups(source, rows, groups, GroupedText(delimiter, mark, given.lost), first + 1)
    tables, copies = _without_copies(tables)
    note = f"TwinCAT Scope, {len(groups)} {'time' if len(groups) == 1 else 'times'}, decimal " + (
        "comma" if mark == "," else "point"
    )
    notes = (note, *([f"{copies} copies of channels left out"] if copies else []))
    return tuple(replace(table, notes=(*notes, *table.notes), decimal=mark) for table in tables)


def _without_copies(tables: Sequence[Table]) -> tuple[list[Table], int]:
    """Leave out what was exported again, as `Force (1)` is where a channel is drawn twice; and how often."""
    seen: dict[str, tuple[MeasuredColumn, MeasuredColumn]] = {}
    kept: list[Table] = []
    copies = 0
    for table in tables:
        time, *channels = table.columns
        own = [time]
        for channel in channels:
            of = AGAIN.sub("", channel.name)
            before = seen.setdefault(of, (time, channel))
            is_copy = before[1] is not channel and all(
                np.array_equal(one.values, other.values, equal_nan=True)
                for one, other in zip(before, (time, channel), strict=True)
            )
            if is_copy and of != channel.name:
                copies += 1
            else:
                own.append(channel)
        if len(own) > 1:
            kept.append(replace(table, columns=tuple(own)))
    return kept, copies


def _cells(line: str, delimiter: str) -> list[str]:
    return [cell.strip().strip('"') for cell in split_cells(line, delimiter)]


def _is_row(line: str, delimiter: str, lost: AbstractSet[str]) -> bool:
    """Whether a line holds numbers alone, but for words that stand for values that were lost."""
    cells = split_cells(line, delimiter)
    filled = [cell for cell in cells if not is_missing(cell) and cell.strip().lower() not in lost]
    return bool(filled) and all(
        parse_number(cell) is not None or parse_number(cell, ",") is not None for cell in filled
    )


def _has_decimal_comma(rows: Sequence[str]) -> bool:
    return any(re.search(r"\d,\d", row) for row in rows[:1000])


def _begun(lines: Sequence[str], delimiter: str) -> np.datetime64 | None:
    for line in lines[1:HEAD_LINES]:
        cells = _cells(line, delimiter)
        if STARTS.match(line) and len(cells) > 1 and is_ticks(cells[1]):
            return moment_of_ticks(int(cells[1]))
    return None


def _groups(header: Sequence[Sequence[str]], begun: np.datetime64 | None) -> list[ColumnGroup]:
    """Columns by the times before them: a column of times has the name of each row in that row."""
    names = header[0]
    rows = {row[0]: row for row in header if len(row) == len(names)}  # not with commas in its numbers
    of_time = [k for k in range(len(names)) if all(row[k] == key for key, row in rows.items())]
    groups = []
    for place, end in zip(of_time, [*of_time[1:], len(names)], strict=True):
        columns = tuple(column for column in range(place + 1, end) if names[column])
        if not columns:
            continue
        step = _cell(rows, "SampleTime[ms]", columns[0])
        groups.append(
            ColumnGroup(
                f"sampled every {step} ms" if step else f"times in column {place + 1}",
                columns,
                tuple(names[column] for column in columns),
                tuple(_unit(rows, column) for column in columns),
                place,
                "ms",
                begun=begun,
                notes=tuple(note for column in columns if (note := _scaling(rows, column, names[column]))),
            )
        )
    return groups


def _cell(rows: Mapping[str, Sequence[str]], key: str, column: int) -> str:
    row = rows.get(key, ())
    return row[column] if column < len(row) else ""


def _unit(rows: Mapping[str, Sequence[str]], column: int) -> str | None:
    """Give the unit of a channel without the quantity in brackets behind it."""
    text = _cell(rows, "Unit", column)
    return None if text in ("", NO_UNIT) else re.sub(r"\s*\([^()]*\)$", "", text)


def _scaling(rows: Mapping[str, Sequence[str]], column: int, name: str) -> str:
    """Tell a scaling that is in the values or not, as was chosen at the export; the file does not say it."""
    for of in ("", "Unit "):
        factor, offset = (_cell(rows, of + key, column) for key in ("ScaleFactor", "Offset"))
        if factor not in ("", "1") or offset not in ("", "0"):
            return (
                f"{name!r} has a scaling of {factor or 1} and {offset or 0} in the Scope: taken as exported"
            )
    return ""
