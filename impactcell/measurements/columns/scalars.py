"""What is constant in a record: mass, velocity, direction and the like, and covariates."""

import math
import re

import numpy as np

from impactcell.campaign import COLUMNS, LARGEST
from impactcell.measurements.columns.assignment import Assignment
from impactcell.measurements.columns.mapping import Mapping
from impactcell.measurements.columns.recognition import (
    TOKEN_MATCH,
    VOCABULARY,
    ColumnMeaning,
    is_kind_of,
    name_score,
    normalised,
)
from impactcell.measurements.notation.numbers import doubt_of_line, number_text, split_stated
from impactcell.measurements.notation.units import Dimension, parse_unit, split_unit
from impactcell.measurements.table import MeasuredColumn, Table

SCALARS = (
    ColumnMeaning.VELOCITY, ColumnMeaning.MASS, ColumnMeaning.DIRECTION, ColumnMeaning.BATCH,
    ColumnMeaning.DWELL, ColumnMeaning.START,
)  # fmt: skip
"""Quantities of which a shot has one value."""
STEADY = 0.01
"""Range of a column as a share of its largest value up to which it is one value with noise; its mean is
taken."""
REQUIREMENTS = {
    ColumnMeaning.VELOCITY: "finite", ColumnMeaning.MASS: "above 0", ColumnMeaning.DIRECTION: "1 or -1",
    ColumnMeaning.DWELL: "0 or above", ColumnMeaning.START: "finite",
}  # fmt: skip
"""What a scalar of a campaign has to be."""
EXAMPLES = {
    ColumnMeaning.VELOCITY: "'velocity=3000 mm/min'", ColumnMeaning.MASS: "mass=18.9kg",
    ColumnMeaning.DIRECTION: "direction=1", ColumnMeaning.DWELL: "dwell=30s",
}  # fmt: skip
"""How a scalar is given for all shots."""
TAKEN_NAMES = {
    *ColumnMeaning, *(name for names in COLUMNS.values() for name in names.values()),
    "shot", "time_s", "velocity_mm_per_min", "dwell_s",
}  # fmt: skip
"""Names of columns that a campaign has itself."""


def scalars_of(table: Table, place: str, mapping: Mapping, faults: list[str]) -> dict[str, float | str]:
    """Give what is constant in a table, from what stands beside its columns and from these; SI units.

    What a shot has one of and that is given for all shots is not looked at. A velocity that changes is nan.
    """
    given = mapping.given.constants
    scalars: dict[str, float | str] = {}
    for meaning, ((value, *others), doubt) in _all_beside(table).items():
        if str(meaning) in given:
            continue
        if doubt:
            way = f", or {_way_out(meaning)}" if meaning in EXAMPLES else ""
            faults.append(f"{place}: {doubt}; write it so{way}")
        elif others and meaning in EXAMPLES:
            unit = VOCABULARY[meaning].dimensions[0].value
            faults.append(
                f"{place}: the lines beside the columns say {meaning} {value:g} {unit} and {others[0]:g} "
                f"{unit}; {_way_out(meaning)}"
            )
        elif not others and _is_possible(meaning, value, f"{place}: {meaning}", faults):
            scalars[str(meaning)] = value
    names = covariate_names(mapping)
    for item in mapping.assignments:
        column = table.column(item.column)
        if column is None or str(item.meaning) in given:
            continue
        if item.meaning is ColumnMeaning.COVARIATE:
            _take_covariate(column, item, names[item.column], scalars)
        elif item.meaning in SCALARS:
            scalar = _one_value(column, item, place, faults)
            where = f"{place}: column {column.name!r} ({item.meaning})"
            if scalar is not None and _is_possible(item.meaning, scalar, where, faults):
                scalars[str(item.meaning)] = scalar
    return scalars


def _is_possible(meaning: ColumnMeaning, value: float | str, where: str, faults: list[str]) -> bool:
    """Whether a scalar can be what it has to be; a fault where it cannot."""
    if meaning is ColumnMeaning.BATCH or isinstance(value, str) or math.isnan(value):
        return True
    requirement = REQUIREMENTS[meaning]
    possible = {"above 0": value > 0.0, "0 or above": value >= 0.0, "1 or -1": value in (1.0, -1.0)}
    if abs(value) < LARGEST and possible.get(requirement, True):
        return True
    unit = VOCABULARY[meaning].dimensions[0]
    shown = f"{value:g}" + ("" if unit is Dimension.NONE else f" {unit.value}")
    faults.append(f"{where} is {shown}; it has to be {requirement}: correct it, or {_way_out(meaning)}")
    return False


def _way_out(meaning: ColumnMeaning) -> str:
    if meaning in EXAMPLES:
        return f"give it for all shots with --set {EXAMPLES[meaning]}"
    return "leave its column out with --column ignored=NAME"


def _one_value(column: MeasuredColumn, item: Assignment, place: str, faults: list[str]) -> float | str | None:
    """Give the value of a column that has one; None where it has none."""
    factor = 1.0 if item.unit is None else item.unit.factor
    if column.text is not None:
        distinct = [text for text in dict.fromkeys(column.text) if text]
        if len(distinct) > 1:
            faults.append(_changes(column, item, place, repr(distinct[0]), repr(distinct[1])))
        return distinct[0] if len(distinct) == 1 else None
    present = column.values[np.isfinite(column.values)]
    if not present.size:
        return None
    low, high = float(present.min()), float(present.max())
    steady = 0.0 if item.meaning in (ColumnMeaning.BATCH, ColumnMeaning.DIRECTION) else STEADY
    if high - low <= steady * max(abs(low), abs(high)):
        return float(factor * (low if low == high else present.mean()))
    if item.meaning is ColumnMeaning.VELOCITY:  # as it was measured, not commanded
        return math.nan
    unit = "" if item.unit is None or item.unit.dimension is Dimension.NONE else f" {item.unit.symbol}"
    shown = number_text if item.meaning is ColumnMeaning.BATCH else "{:g}".format
    faults.append(_changes(column, item, place, f"{shown(low)}{unit}", f"{shown(high)}{unit}"))
    return None


def _changes(column: MeasuredColumn, item: Assignment, place: str, one: str, other: str) -> str:
    return (
        f"{place}: column {column.name!r} ({item.meaning}) is {one} and {other} within one record, where a "
        f"shot has one; number the shots with --column shot=NAME, or {_way_out(item.meaning)}"
    )


def _take_covariate(
    column: MeasuredColumn, item: Assignment, name: str, scalars: dict[str, float | str]
) -> None:
    """Take the value of a covariate where it does not change, else its mean; a text only where it is one."""
    if column.text is not None:
        distinct = list(dict.fromkeys(column.text))
        if len(distinct) == 1 and distinct[0]:
            scalars[name] = distinct[0]
        return
    factor, offset = (1.0, 0.0) if item.unit is None else (item.unit.factor, item.unit.offset)
    present = column.values[np.isfinite(column.values)]
    if present.size:
        scalars[name] = float(factor * (present[0] if np.ptp(present) == 0.0 else present.mean()) + offset)


def covariate_names(mapping: Mapping) -> dict[str, str]:
    """Names of the covariates in `shots.csv` by their columns; each once, and none that a campaign has."""
    names: dict[str, str] = {}
    taken = set(TAKEN_NAMES)
    for item in mapping.assignments:
        if item.meaning is not ColumnMeaning.COVARIATE:
            continue
        base = covariate_name(item.column, item.unit.dimension if item.unit else None)
        base = f"{base}_column" if base in TAKEN_NAMES else base
        name, count = base, 1
        while name in taken:
            count += 1
            name = f"{base}_{count}"
        taken.add(name)
        names[item.column] = name
    return names


def covariate_name(column: str, dimension: Dimension | None) -> str:
    """Name of a covariate in `shots.csv`: of the column, with its SI unit.

    Examples
    --------
    >>> covariate_name("Druck p1", Dimension.PRESSURE), covariate_name("Öl", None)
    ('druck_p1_pa', 'oel')
    """
    name = normalised(column) or re.sub(r"\W+", "_", column.lower()).strip("_") or "covariate"
    if dimension is None or dimension is Dimension.NONE:
        return name
    return f"{name}_{normalised(dimension.value.replace('²', '2').replace('/', ' per '))}"


def said_beside(table: Table) -> dict[ColumnMeaning, float | str]:
    """Quantities of which the file says one value beside its columns, as `Masse: 18,9 kg`."""
    return {meaning: values[0] for meaning, (values, _) in _all_beside(table).items() if len(values) == 1}


def _all_beside(table: Table) -> dict[ColumnMeaning, tuple[list[float | str], str]]:
    """Every value that the lines beside the columns say of a quantity by the name that fits it best.

    `Masse` goes before `Masse Greifer`. Beside them what one of these lines may say otherwise.
    """
    said: dict[ColumnMeaning, list[float | str]] = {}
    scores: dict[ColumnMeaning, float] = {}
    doubts: dict[ColumnMeaning, str] = {}
    for key, text in table.attributes.items():
        found = _quantity_beside(key, text, table.decimal)
        if found is None or found[1] < scores.get(found[0], -1.0):
            continue
        meaning, score, value = found
        if score > scores.get(meaning, -1.0):
            said[meaning], scores[meaning], doubts[meaning] = [], score, ""
        if value not in said[meaning]:
            said[meaning].append(value)
        if isinstance(value, float):
            doubts[meaning] = doubts[meaning] or doubt_of_line(key, text, table.decimal)
    return {meaning: (values, doubts[meaning]) for meaning, values in said.items()}


def _quantity_beside(key: str, text: str, decimal: str) -> tuple[ColumnMeaning, float, float | str] | None:
    """Give what a line beside the columns says of which quantity, and how sure its name is."""
    name, unit_text = split_unit(key)
    for meaning in SCALARS:
        score = name_score(name, meaning)[0]
        # Nothing else is in mm/min: there a word inside a longer one will do, as in "Vorschubgeschw".
        is_named = score > 0.0 if meaning is ColumnMeaning.VELOCITY else score >= TOKEN_MATCH
        if not is_named and not is_kind_of(name, meaning):
            continue
        number, rest = split_stated(text, decimal)
        unit = parse_unit(unit_text or rest)
        if meaning is ColumnMeaning.BATCH:
            return meaning, score, text
        if number is None:
            return None
        if meaning is ColumnMeaning.DIRECTION:
            return meaning, score, number
        if unit is not None and unit.dimension in VOCABULARY[meaning].dimensions:
            return meaning, score, number * unit.factor
        return None
    return None
