"""Records in SI units: what the columns of a file are once it is said what they mean."""

from collections.abc import Mapping as AbstractMapping
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.integrate import cumulative_trapezoid

from impactcell.campaign import LARGEST
from impactcell.errors import MeasurementError
from impactcell.measurements.columns.mapping import Mapping
from impactcell.measurements.columns.recognition import CHANNELS, ColumnMeaning
from impactcell.measurements.columns.sampling_step import doubt_of_step, sampling_step_s
from impactcell.measurements.columns.scalars import scalars_of
from impactcell.measurements.faults import raise_faults
from impactcell.measurements.notation.numbers import number_text
from impactcell.measurements.records.groups import places_beside
from impactcell.measurements.records.times_out_of_order import not_increasing
from impactcell.measurements.table import MeasuredColumn, Table
from impactcell.records import Samples


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """Channels that were recorded together, and what is constant meanwhile.

    Attributes
    ----------
    place : str
        Where it is from, as faults name it.
    times, values : mapping
        Of each channel, shape (n,), s and SI units; only samples that are there.
    scalars : mapping
        Quantities and covariates that are constant, SI units or text.
    shot : str
        Number of the shot, as a column says it; empty where none does.
    begun : datetime64 or None
        Moment from which the times count, where the file says it.
    constant_as : str
        How its file would say what is constant.
    """

    place: str
    times: AbstractMapping[ColumnMeaning, Samples]
    values: AbstractMapping[ColumnMeaning, Samples]
    scalars: AbstractMapping[str, float | str] = field(default_factory=dict)
    shot: str = ""
    begun: np.datetime64 | None = None
    constant_as: str = ""


def records_by_file(tables: Sequence[Table], mapping: Mapping) -> dict[str, list[Record]]:
    """Give the records of each file: one a shot where there is a column of shots, else one a table.

    Tables of one file whose channels differ belong to one record; those with the same channels are several.
    A table without any beside them needs no time: it says what is constant in those of its group.

    Raises
    ------
    MeasurementError
        A file lacks a column, its time does not increase, a text stands where a number has to, or a rate
        is given for one table of a file where another has times of its own.
    """
    faults = _contrary_clocks(tables, mapping)
    raise_faults(faults)
    by_file: dict[str, list[Record]] = {}
    groups: dict[str, list[str]] = {}
    measured = {table.source for table in tables if _has_channel(table, mapping)}
    beside: dict[Table, int] = {}
    for table in tables:
        records, of = by_file.setdefault(table.source, []), groups.setdefault(table.source, [])
        if table.source in measured and not _has_channel(table, mapping):
            beside[table] = max(len(records) - 1, 0)
            continue
        for part, place, shot in _parts(table, mapping, faults):
            record = _record(part, place, shot, mapping, faults)
            if record is None:
                continue
            if records and not set(records[-1].values) & set(record.values):
                records[-1] = _together(records[-1], record)
            else:
                records.append(record)
                of.append(table.name)
    for table, places in places_beside(beside, groups, mapping).items():
        by_file[table.source] = _with_beside(by_file[table.source], places, table, mapping, faults)
    raise_faults(faults)
    by_file = {file: [record for record in records if record.values] for file, records in by_file.items()}
    if not any(by_file.values()):
        raise MeasurementError("no table holds a channel")
    return by_file


def _has_channel(table: Table, mapping: Mapping) -> bool:
    return any(item.meaning in CHANNELS and table.column(item.column) for item in mapping.assignments)


def _with_beside(
    records: Sequence[Record], places: AbstractSet[int], table: Table, mapping: Mapping, faults: list[str]
) -> list[Record]:
    """Give the records with what is constant in a table without a channel, by their shots if numbered."""
    numbered = any(record.shot for place, record in enumerate(records) if place in places)
    parts = _parts(table, mapping, faults) if numbered else [(table, table.title, "")]
    said = {shot: scalars_of(part, where, mapping, faults) for part, where, shot in parts}
    return [
        replace(record, scalars={**said.get("", {}), **said.get(record.shot, {}), **record.scalars})
        if place in places
        else record
        for place, record in enumerate(records)
    ]


def _contrary_clocks(tables: Sequence[Table], mapping: Mapping) -> list[str]:
    """Tell tables that a given rate would count for beside one of the same file with times of its own."""
    if "rate_hz" not in mapping.given.constants:
        return []
    measured = [table for table in tables if _has_channel(table, mapping)]
    timed = {
        table.source: (table, item.column)
        for table in measured
        if (item := mapping.time_of(table)) is not None
    }
    faults = []
    for table in measured:
        if table.source in timed and mapping.time_of(table) is None:
            other, column = timed[table.source]
            faults.append(
                f"{table.title}: has no column of time, where {other.title} has {column!r}, and the rate "
                f"does not say how the two stand to each other; export both with their times, or say "
                f"--column 'ignored={column}' for the rate to count for both"
            )
    return faults


def _shot_column(table: Table, mapping: Mapping) -> MeasuredColumn | None:
    shot = mapping.of(ColumnMeaning.SHOT)
    return None if shot is None else table.column(shot.column)


def _parts(table: Table, mapping: Mapping, faults: list[str]) -> list[tuple[Table, str, str]]:
    """Rows of each shot, where they are found and its number, in order of appearance."""
    column = _shot_column(table, mapping)
    if column is None:
        return [(table, table.title, "")]
    keys = np.array(column.text) if column.text is not None else column.values
    if column.text is None and np.isnan(keys).any():
        row = int(np.flatnonzero(np.isnan(keys))[0])
        faults.append(f"{table.place(row)}: column {column.name!r} is empty; every row needs its shot")
        return []
    distinct, first = np.unique(keys, return_index=True)
    if len(distinct) > max(0.2 * len(keys), 1) and len(keys) > 50 and _has_channel(table, mapping):
        faults.append(
            f"{table.title}: column {column.name!r} has {len(distinct)} values in {len(keys)} rows, so it "
            f"does not number shots; name the column that does with --column shot=NAME, or leave this one "
            f"out with --column 'ignored={column.name}'"
        )
        return []
    parts = []
    for key in distinct[np.argsort(first)]:
        rows = np.flatnonzero(keys == key)
        number = number_text(float(key)) if column.text is None else str(key)
        place = f"{column.name} {number}" if column.text is None else number
        parts.append((table.rows(rows), f"{table.title}: {place}", number))
    return parts


def _record(table: Table, place: str, shot: str, mapping: Mapping, faults: list[str]) -> Record | None:
    time = _time(table, mapping, faults)
    if time is None:
        return None
    of_time = mapping.time_of(table)
    clock = None if of_time is None else table.column(of_time.column)
    times: dict[ColumnMeaning, Samples] = {}
    values: dict[ColumnMeaning, Samples] = {}
    for meaning in CHANNELS:
        item = mapping.of(meaning)
        column = None if item is None else table.column(item.column)
        if item is None or column is None or item.unit is None:
            continue
        present = np.isfinite(column.values)
        infinite = np.flatnonzero(np.abs(item.unit.factor * column.values) >= LARGEST)
        if infinite.size:
            faults.append(
                f"{table.place(int(infinite[0]))}: column {column.name!r} is infinite, or beyond any "
                f"measurement, in {infinite.size} rows; correct them, or have no value there"
            )
        elif column.text is not None:
            faults.append(f"{table.title}: column {column.name!r} holds text, where the {meaning} is needed")
        elif not present.any():
            faults.append(f"{table.title}: column {column.name!r} ({meaning}) has no value at all")
        else:
            times[meaning] = time[present] - mapping.given.delays.get(meaning, 0.0)
            measured = item.unit.factor * mapping.given.signs.get(meaning, 1) * column.values[present]
            values[meaning] = _summed_up(times[meaning], measured) if item.summed_up else measured
    scalars = scalars_of(table, place, mapping, faults)
    begun = None if clock is None else clock.begun
    return Record(place, times, values, scalars, shot, begun, table.constant_as)


def _summed_up(time_s: Samples, speed: Samples) -> Samples:
    """Position of a speed [m/s or rad/s], from 0 at the first sample, by the trapezoidal rule."""
    return np.asarray(cumulative_trapezoid(speed, time_s, initial=0), dtype=np.float64)


def _time(table: Table, mapping: Mapping, faults: list[str]) -> Samples | None:
    item = mapping.time_of(table)
    column = None if item is None else table.column(item.column)
    if item is None or column is None:
        step = sampling_step_s(table, mapping.given.constants)
        if step is None:
            why = f": {doubt}" if (doubt := doubt_of_step(table)) else ""
            faults.append(
                f"{table.title}: has no column of time{why}; name it, or give the rate with --set rate=10kHz"
            )
            return None
        return np.asarray(step * np.arange(len(table)), dtype=np.float64)
    if item.unit is None:
        faults.append(
            f"{table.title}: column {column.name!r} (time) has no unit; say --unit '{column.name}=s'"
        )
        return None
    time = item.unit.factor * column.values
    empty = np.flatnonzero(~(np.abs(time) < LARGEST))
    if empty.size:
        faults.append(
            f"{table.place(int(empty[0]))}: column {column.name!r} is empty or infinite in {empty.size} "
            f"rows; every row needs its time"
        )
        return None
    steps = np.diff(time)
    if (steps <= 0.0).any():
        faults.append(not_increasing(table, column, steps))
        return None
    return time


def later_s(first: Record, second: Record) -> float:
    """How much later than those of the first the times of the second begin [s]; 0 where one does not say."""
    if first.begun is None or second.begun is None:
        return 0.0
    return float((second.begun - first.begun) / np.timedelta64(1, "s"))


def _together(first: Record, second: Record) -> Record:
    begun, later = (first.begun, later_s(first, second)) if first.times else (second.begun, 0.0)
    return Record(
        first.place,
        {**first.times, **{channel: time + later for channel, time in second.times.items()}},
        {**first.values, **second.values},
        {**first.scalars, **second.scalars},
        first.shot,
        begun,
        first.constant_as,
    )
