"""Mass and velocity as files state them: what is read, what is not for want of a unit, what goes before."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from impactcell.measurements.columns.given_values import Given
from impactcell.measurements.columns.mapping import Mapping
from impactcell.measurements.columns.recognition import (
    VOCABULARY,
    WORD_MATCH,
    ColumnMeaning,
    is_kind_of,
    name_score,
)
from impactcell.measurements.columns.scalars import EXAMPLES, said_beside
from impactcell.measurements.faults import raise_faults
from impactcell.measurements.notation.numbers import split_stated
from impactcell.measurements.notation.units import parse_unit, split_unit
from impactcell.measurements.records.measured_records import Record
from impactcell.measurements.table import Table
from impactcell.records import MM_PER_MIN

SHOWN = {ColumnMeaning.MASS: (1.0, "kg"), ColumnMeaning.VELOCITY: (1.0 / MM_PER_MIN, "mm/min")}
"""What files state in numbers and a shot has one of: factor and unit in which it is shown."""
WRITTEN = {ColumnMeaning.MASS: "18.9 kg", ColumnMeaning.VELOCITY: "3000 mm/min"}
"""How a line states it."""
SAME = 1e-3
"""Share of a value up to which another is the same, rounded."""


@dataclass(frozen=True, slots=True)
class _UnreadLine:
    """A line beside the columns that is called as a quantity and states it in no unit of it."""

    file: str
    key: str
    text: str
    number: float
    has_unit: bool

    def told(self, meaning: ColumnMeaning) -> str:
        said = f"{self.text}, which is no {meaning}," if self.has_unit else f"{self.text} without a unit"
        return f"the line {self.key!r} says {said} and is not used"


def notes_of_stated(tables: Sequence[Table], records: Sequence[Record], mapping: Mapping) -> list[str]:
    """Tell what was read of mass and velocity beside the columns, what was not, and what goes before it."""
    return [
        *_said_of(tables, mapping.given),
        *(note for meaning in SHOWN for note in _overruled(tables, mapping, meaning)),
        *(note for meaning in SHOWN for note in _unread(tables, records, mapping, meaning)),
    ]


def refuse_unread_velocity(tables: Sequence[Table], records: Sequence[Record], mapping: Mapping) -> None:
    """Refuse taps whose velocity a line states in no unit of it, and nothing else does.

    Raises
    ------
    MeasurementError
        With the line of each file.
    """
    velocity = ColumnMeaning.VELOCITY
    if _is_lacking(records, mapping, velocity):
        raise_faults(
            [
                f"{line.file}: {line.told(velocity)}; write it as '{line.key}: {WRITTEN[velocity]}', or give "
                f"it for all shots with --set {EXAMPLES[velocity]}"
                for line in _unread_lines(tables, velocity)
            ]
        )


def has_unread_mass(tables: Sequence[Table]) -> bool:
    """Whether a line states a mass in no unit of it."""
    return any(True for _ in _unread_lines(tables, ColumnMeaning.MASS))


def _said_of(tables: Sequence[Table], given: Given) -> list[str]:
    """Tell what was read of mass and velocity beside the columns, where nothing else was given."""
    said = [said_beside(table) for table in tables]
    told = []
    for meaning, (factor, unit) in SHOWN.items():
        if str(meaning) in given.constants:
            continue
        values = [value for of in said if isinstance(value := of.get(meaning), float)]
        if values:
            told.append(f"{meaning} {_range([factor * value for value in values])} {unit}")
    return [f"the lines beside the columns say: {', '.join(told)}"] if told else []


def _range(values: Sequence[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:.6g}{'' if low == high else f' to {high:.6g}'}"


def _overruled(tables: Sequence[Table], mapping: Mapping, meaning: ColumnMeaning) -> Iterator[str]:
    """Tell what files say otherwise than what was given for all shots."""
    given = mapping.given.constants.get(str(meaning))
    if given is None:
        return
    factor, unit = SHOWN[meaning]
    before = f"{meaning} {factor * given:.6g} {unit}, as given, goes before what the files say"
    read = [value for table in tables for value in _stated(table, mapping, meaning)]
    if any(not math.isclose(abs(value), abs(given), rel_tol=SAME) for value in read):
        yield f"{before}: {_range([factor * value for value in read])} {unit}"
    unread = {line.number for line in _unread_lines(tables, meaning) if not line.has_unit}
    if len(unread) > 1:
        yield f"{before} without a unit: {_range(list(unread))}"


def _stated(table: Table, mapping: Mapping, meaning: ColumnMeaning) -> list[float]:
    """Values of a quantity in the column of a table, or else beside its columns [SI units]."""
    item = mapping.of(meaning)
    column = None if item is None else table.column(item.column)
    if item is not None and item.unit is not None and column is not None and column.text is None:
        present = column.values[np.isfinite(column.values)]
        return [item.unit.factor * float(value) for value in present[[0, -1]]] if present.size else []
    value = said_beside(table).get(meaning)
    return [value] if isinstance(value, float) else []


def _unread(
    tables: Sequence[Table], records: Sequence[Record], mapping: Mapping, meaning: ColumnMeaning
) -> Iterator[str]:
    if not _is_lacking(records, mapping, meaning):
        return
    lines = list(_unread_lines(tables, meaning))
    if lines:
        first, *others = lines
        files = f"in {len(lines)} files, the first {Path(first.file).name}" if others else "in 1 file"
        yield (
            f"{first.told(meaning)}, {files}; give --set {EXAMPLES[meaning]} for all shots, or write it with "
            f"its unit, as '{first.key}: {WRITTEN[meaning]}'"
        )


def _is_lacking(records: Sequence[Record], mapping: Mapping, meaning: ColumnMeaning) -> bool:
    """Whether a quantity of some record is known by nothing."""
    if str(meaning) in mapping.given.constants:
        return False
    by_channel = meaning is ColumnMeaning.VELOCITY
    return any(
        str(meaning) not in record.scalars and not (by_channel and ColumnMeaning.ACTUATOR in record.values)
        for record in records
    )


def _unread_lines(tables: Sequence[Table], meaning: ColumnMeaning) -> Iterator[_UnreadLine]:
    """Give the first line of each table that is called as a quantity and states it in no unit of it."""
    for table in tables:
        if meaning in said_beside(table):
            continue
        for key, text in table.attributes.items():
            name, unit = split_unit(key)
            number, rest = split_stated(text, table.decimal)
            unit = (unit or rest).strip("[]() ")
            called = name_score(name, meaning)[0] >= WORD_MATCH or is_kind_of(name, meaning)
            if called and number is not None and math.isfinite(number):
                known = parse_unit(unit)
                if known is None or known.dimension not in VOCABULARY[meaning].dimensions:
                    yield _UnreadLine(table.recorded_in, key, text, number, bool(unit))
                    break
