"""Measurement files of LabVIEW (LVM): segments with a header each, times by a step or in columns.

National Instruments, "Specification for the LabVIEW Measurement File (.lvm)", 2012.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from impactcell.errors import MeasurementError
from impactcell.measurements.files.column_groups import ColumnGroup, GroupedText, tables_of_groups
from impactcell.measurements.files.dialect import Dialect
from impactcell.measurements.files.limits import Limits
from impactcell.measurements.notation.moments import read_moments
from impactcell.measurements.notation.numbers import parse_number
from impactcell.measurements.notation.units import split_unit
from impactcell.measurements.table import MeasuredColumn, Table

BEGINS, END_OF_HEADER, NAMES = "LabVIEW Measurement", "***End_of_Header***", "X_Value"
COMMENT = "Comment"
"""Last column of each segment: text, which is left out."""
SEPARATOR = re.compile(r"Separator([\t,;])")
"""Line that says what separates cells, and is separated so itself."""
UNITS = {"volts": "V", "amps": "A"}
"""Units as LabVIEW writes them, where that is no word for one elsewhere."""
GAP_STEPS = 0.5
"""How many steps the next segment may lie beside the place of the next sample to go on with its record."""


@dataclass(frozen=True, slots=True)
class _Header:
    """What stands above one segment, by its keys: a cell for each channel."""

    said: Mapping[str, tuple[str, ...]]
    names: tuple[str, ...]


def is_labview(lines: Sequence[str]) -> bool:
    """Whether lines are of such a file."""
    return lines[0].startswith(BEGINS)


def read_labview(source: str, lines: Sequence[str], limits: Limits, given: Dialect) -> tuple[Table, ...]:
    """Read all segments; those that go on where the one before ended are one record.

    Parameters
    ----------
    source : str
    lines : sequence of str
    limits : Limits
    given : Dialect
        Its decimal mark, where the file is not to say it, and words for lost values.

    Raises
    ------
    MeasurementError
        The file has no header, or cells that are no numbers, by file and line.
    """
    end = next((row for row, line in enumerate(lines) if line.startswith(END_OF_HEADER)), None)
    if end is None:
        raise MeasurementError(f"{source}: is cut off in its header: {END_OF_HEADER} is missing")
    delimiter = next((found[1] for line in lines[:end] if (found := SEPARATOR.match(line))), "\t")
    of_file = _keys(lines[:end], delimiter)
    mark = given.decimal or _first(of_file, "Decimal_Separator")
    header: _Header | None = None
    tables: list[Table] = []
    segments, notes = 0, []
    for begin, until in _blocks(lines, end + 1, delimiter):
        first = begin
        names_row = next((row for row in range(begin, until) if _is_names(lines[row], delimiter)), None)
        if names_row is not None:
            header = _Header(
                _keys(lines[begin:names_row], delimiter), tuple(_cells(lines[names_row], delimiter))
            )
            first = names_row + 1
        if header is None:
            raise MeasurementError(
                f"{source}:{begin + 1}: a row of names that begins with {NAMES!r} is missing above these rows"
            )
        rows = lines[first:until]
        if not rows:
            continue
        segments += 1
        groups = _groups(header, of_file, f"segment {segments}", mark or ".", f"{source}:{begin + 1}")
        limits.check_shape(source, len(rows), len(header.names))
        counted = parse_number(_of(header, "Samples", 0))
        if counted is not None and 0.0 < counted < len(rows) and any(group.time is None for group in groups):
            notes.append(
                f"{len(rows)} rows from line {first + 1} under a header of {counted:.0f} samples: taken to "
                f"follow each other without a gap"
            )
        text = GroupedText(delimiter, mark or _mark(rows, delimiter), given.lost)
        read = tables_of_groups(source, rows, groups, text, first + 1)
        tables += (replace(table, name=f"segment {segments}") for table in read)
    if not tables:
        raise MeasurementError(f"{source}: holds no samples")
    said = {key: values[0] for key, values in of_file.items() if values and values[0]}
    note = f"LabVIEW measurement, {segments} {'segment' if segments == 1 else 'segments'}"
    joined = _joined(tables)
    only = len({table.name for table in joined}) == 1
    return tuple(
        replace(
            table,
            name="" if only else table.name,
            attributes=said,
            notes=(note, *notes, *table.notes),
            decimal=mark or ".",
        )
        for table in joined
    )


def _cells(line: str, delimiter: str) -> list[str]:
    return [cell.strip() for cell in line.split(delimiter)]


def _keys(lines: Sequence[str], delimiter: str) -> dict[str, tuple[str, ...]]:
    said = {}
    for line in lines:
        key, *values = _cells(line, delimiter)
        if key:
            said[key] = tuple(values)
    return said


def _first(said: Mapping[str, tuple[str, ...]], key: str) -> str:
    return next(iter(said.get(key, ())), "")


def _is_names(line: str, delimiter: str) -> bool:
    return line.split(delimiter, maxsplit=1)[0].strip() == NAMES


def _blocks(lines: Sequence[str], begin: int, delimiter: str) -> list[tuple[int, int]]:
    """Begin and end of each run of lines that hold something."""
    empty = [row for row in range(begin, len(lines)) if not lines[row].strip(delimiter + " ")]
    return [(one + 1, other) for one, other in pairwise([begin - 1, *empty, len(lines)]) if other > one + 1]


def _mark(rows: Sequence[str], delimiter: str) -> str:
    """Tell the decimal mark where the file does not say it."""
    sample = rows[:200]
    return "," if delimiter != "," and any(re.search(r"\d,\d", row) for row in sample) else "."


def _groups(
    header: _Header, of_file: Mapping[str, tuple[str, ...]], place: str, decimal: str, where: str
) -> list[ColumnGroup]:
    """Channels of a segment by what their times are; what is said of one has no cell for the first column."""
    names = header.names[: -1 if header.names[-1] == COMMENT else None]
    how = _first(of_file, "X_Columns").lower()
    channels = [
        column for column in range(len(names)) if column and (how != "multi" or names[column] != NAMES)
    ]
    groups: dict[tuple[int | None, float, float, np.datetime64 | None], list[int]] = {}
    for column in channels:
        begun = _begun(header, column - 1)
        if how == "multi":
            time = max((k for k in range(column) if names[k] == NAMES), default=None)
        else:
            time = 0 if how == "one" else None
        first = step = 0.0
        if time is None:
            first, step = (_number(header, key, column - 1, decimal) for key in ("X0", "Delta_X"))
            if not (math.isfinite(first) and 0.0 < step < math.inf):
                raise MeasurementError(
                    f"{where}: channel {names[column]!r} says no step of its times (Delta_X); export X "
                    f"values too"
                )
        groups.setdefault((time, first, step, begun), []).append(column)
    made = []
    for (time, first, step, begun), columns in groups.items():
        said = [split_unit(names[column]) for column in columns]
        units = []
        for column, (_, unit) in zip(columns, said, strict=True):
            label = _of(header, "Y_Unit_Label", column - 1)
            units.append(UNITS.get(label.lower(), label) or unit)
        made.append(
            ColumnGroup(
                place,
                tuple(columns),
                tuple(name for name, _ in said),
                tuple(units),
                time,
                first_s=first,
                step_s=step,
                begun=begun,
            )
        )
    return made


def _of(header: _Header, key: str, place: int) -> str:
    values = header.said.get(key, ())
    return values[place] if place < len(values) else ""


def _number(header: _Header, key: str, place: int, decimal: str) -> float:
    cell = _of(header, key, place)
    for mark in (decimal, "." if decimal == "," else ","):
        value = parse_number(cell, mark) if cell else None
        if value is not None:
            return value
    return 0.0 if key == "X0" else math.nan


def _begun(header: _Header, place: int) -> np.datetime64 | None:
    day, clock = _of(header, "Date", place), _of(header, "Time", place)
    read = read_moments([f"{day} {clock}"]) if day and clock else None
    return None if read is None else read.begun


def _joined(tables: Sequence[Table]) -> list[Table]:
    """Put the segments together that go on where the one before ended, channel by channel."""
    made: list[Table] = []
    for table in tables:
        names = [column.name for column in table.columns]
        place = next(
            (k for k, one in reversed(list(enumerate(made))) if names == [c.name for c in one.columns]), None
        )
        if place is not None and (put := _continued(made[place], table)) is not None:
            made[place] = put
        else:
            made.append(table)
    return made


def _continued(first: Table, second: Table) -> Table | None:
    """Give two tables as one where the second goes on in the step of the first; None where it does not."""
    time, other = first.columns[0], second.columns[0]
    if len(time.values) < 2 or not len(other.values) or first.lines is None or second.lines is None:
        return None
    later = 0.0
    if time.begun is not None and other.begun is not None:
        later = float((other.begun - time.begun) / np.timedelta64(1, "s"))
    step = float(np.median(np.diff(time.values)))
    for shift in {0.0, later}:
        if abs(other.values[0] + shift - time.values[-1] - step) < GAP_STEPS * step:
            columns = [
                MeasuredColumn(
                    one.name,
                    one.unit,
                    np.concatenate([one.values, two.values + (shift if place == 0 else 0.0)]),
                    begun=one.begun,
                )
                for place, (one, two) in enumerate(zip(first.columns, second.columns, strict=True))
            ]
            return replace(first, columns=tuple(columns), lines=np.concatenate([first.lines, second.lines]))
    return None
