"""Files that hold different channels of the same records, as where force and position were logged apart."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path

from impactcell.errors import MeasurementError
from impactcell.measurements.columns.mapping import Mapping
from impactcell.measurements.columns.recognition import CHANNELS, ColumnMeaning
from impactcell.measurements.notation.numbers import number_text
from impactcell.measurements.records.measured_records import Record, later_s, records_by_file
from impactcell.measurements.table import Table


def of_one_recording(tables: Sequence[Table], mapping: Mapping) -> list[Table]:
    """Say of files that hold different channels which were recorded together; those come side by side.

    Where no file has a channel that files of another kind have, and there are as many files of each kind, the
    first of each belong together, and so on. All else is left as it is.

    Raises
    ------
    MeasurementError
        There are more files of one kind than of another.
    """
    kinds = _kinds(tables, mapping)
    if len(kinds) < 2 or any(one & other for one, other in combinations(kinds, 2)):
        return list(tables)
    if len({len(files) for files in kinds.values()}) > 1:
        told = ", ".join(f"{len(files)} with {' and '.join(sorted(kind))}" for kind, files in kinds.items())
        raise MeasurementError(
            f"files: {told}; a record is put together of one of each, so name as many of each"
        )
    together = [" and ".join(files) for files in zip(*kinds.values(), strict=True)]
    recording = {file: name for files in kinds.values() for file, name in zip(files, together, strict=True)}
    marked = [replace(table, recording=recording.get(table.source, "")) for table in tables]
    order = {name: place for place, name in enumerate(together)}
    return sorted(marked, key=lambda table: order.get(table.recording, len(order)))


def _kinds(tables: Sequence[Table], mapping: Mapping) -> dict[frozenset[ColumnMeaning], list[str]]:
    """Files by the channels that they hold; those with none are left out."""
    columns = {item.column: item.meaning for item in mapping.assignments if item.meaning in CHANNELS}
    held: dict[str, set[ColumnMeaning]] = {}
    for table in tables:
        found = {columns[column.name] for column in table.columns if column.name in columns}
        held.setdefault(table.source, set()).update(found)
    kinds: dict[frozenset[ColumnMeaning], list[str]] = {}
    for file, channels in held.items():
        if channels:
            kinds.setdefault(frozenset(channels), []).append(file)
    return kinds


def records_of(tables: Sequence[Table], mapping: Mapping) -> tuple[list[Record], list[str]]:
    """Give the records of all tables, those of one recording put together, and how their times were set.

    Raises
    ------
    MeasurementError
        As of `records_by_file`; or files of one recording do not hold the same shots, or what they hold was
        not recorded at the same time.
    """
    recording_of = {table.source: table.recorded_in for table in tables}
    recordings: dict[str, list[list[Record]]] = {}
    for file, of_file in records_by_file(tables, mapping).items():
        recordings.setdefault(recording_of[file], []).append(of_file)
    records: list[Record] = []
    told: list[str] = []
    for files in recordings.values():
        if len(files) == 1:
            records += files[0]
            continue
        for parts in _same_shots(files):
            record, how = _at_one_time(parts)
            records.append(record)
            told.append(how)
    more = f"; {len(told) - 1} more likewise" if len(told) > 1 else ""
    return records, [f"put together: {told[0]}{more} (--delay moves a channel)"] if told else []


def _same_shots(files: Sequence[Sequence[Record]]) -> Iterator[tuple[Record, ...]]:
    """Give the parts of each record of several files."""
    first, *others = files
    for records in others:
        if len(records) != len(first):
            raise MeasurementError(
                f"{records[0].place}: holds {len(records)} shots, where {first[0].place}, which it is put "
                f"together with, holds {len(first)}; name files of the same shots"
            )
        for record, beside in zip(records, first, strict=True):
            if record.shot != beside.shot:
                raise MeasurementError(
                    f"{record.place}: holds shot {record.shot or '?'}, where {beside.place}, which it is put "
                    f"together with, holds shot {beside.shot or '?'}; name files of the same shots"
                )
    return zip(*files, strict=True)


def _at_one_time(parts: Sequence[Record]) -> tuple[Record, str]:
    """Put the channels of parts of one record together, by their moments where all say them, and tell how."""
    places = " and ".join(part.place for part in parts)
    shown = [Path(part.place.partition(": ")[0]).name for part in parts]
    later, how = [0.0] * len(parts), "their times are taken to begin at one moment"
    if all(part.begun is not None for part in parts):
        later = [later_s(parts[0], part) for part in parts]
        apart = max(later) - min(later)
        how = f"by the moments that they say, {apart:.6g} s apart"
    times = {
        channel: time + shift
        for part, shift in zip(parts, later, strict=True)
        for channel, time in part.times.items()
    }
    for (one, first), (other, second) in combinations(times.items(), 2):
        if first[-1] < second[0] or second[-1] < first[0]:
            raise MeasurementError(
                f"{places}: the {one} was recorded from {first[0]:.6g} to {first[-1]:.6g} s and the {other} "
                f"from {second[0]:.6g} to {second[-1]:.6g} s, so they are not of one record; export both "
                f"with times of one clock"
            )
    together = Record(
        parts[0].place,
        times,
        {channel: values for part in parts for channel, values in part.values.items()},
        _of_all(parts),
        parts[0].shot,
        parts[0].begun,
        parts[0].constant_as,
    )
    return together, f"{' and '.join(shown)}, {how}"


def _of_all(parts: Sequence[Record]) -> dict[str, float | str]:
    """Give what is constant in a record, of whichever of its files says it."""
    said: dict[str, tuple[float | str, str]] = {}
    for part in parts:
        for name, value in part.scalars.items():
            before, place = said.get(name, (math.nan, ""))
            if _is_unknown(before):
                said[name] = value, part.place
            elif value != before and not _is_unknown(value):
                raise MeasurementError(
                    f"{part.place}: says {name} {_shown(value)} and {place}, which it is put together with, "
                    f"{_shown(before)}; correct one, or leave the column out with --column 'ignored=NAME'"
                )
    return {name: value for name, (value, _) in said.items()}


def _is_unknown(value: float | str) -> bool:
    return isinstance(value, float) and math.isnan(value)


def _shown(value: float | str) -> str:
    return value if isinstance(value, str) else number_text(value)
