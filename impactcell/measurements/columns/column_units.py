"""Unit of a column: as its file says it, as it was given, and where the files do not say the same."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from impactcell.measurements.columns.assignment import UNITLESS, Assignment, no_unit, rotates
from impactcell.measurements.columns.recognition import ColumnMeaning
from impactcell.measurements.notation.gains import Gain
from impactcell.measurements.notation.units import Dimension, MeasuredUnit, parse_unit
from impactcell.measurements.table import MeasuredColumn, Table


def unit_of(column: MeasuredColumn, units: Mapping[str, str]) -> MeasuredUnit | None:
    """Give the unit of a column, as given by its name or as its file says; None where neither is known."""
    text = units.get(column.name) or column.unit
    return None if text is None else parse_unit(text)


def measured_unit(
    unit: MeasuredUnit | None, meaning: ColumnMeaning, gains: Mapping[ColumnMeaning, Gain]
) -> MeasuredUnit | None:
    """Give the unit of what is measured, where a gain says what the signal in a column stands for."""
    gain = gains.get(meaning)
    return unit if gain is None else gain.measured(unit) or unit


def without_unit(
    tables: Sequence[Table],
    assignments: Sequence[Assignment],
    units: Mapping[str, str],
    gains: Mapping[ColumnMeaning, Gain],
) -> list[str]:
    """Tell columns that have their unit from another table, and none that is known in their own."""
    items = {item.column: item for item in assignments}
    faults: dict[str, str] = {}
    for table in tables:
        for column in table.columns:
            item = items[column.name]
            if item.unit is None or item.meaning in UNITLESS:
                continue
            if measured_unit(unit_of(column, units), item.meaning, gains) is None:
                lack = no_unit(item, column.unit or "", turns=rotates(item, assignments))
                faults.setdefault(column.name, f"{table.title}: {lack}")
    return list(faults.values())


def covariates_without_unit(
    tables: Sequence[Table], assignments: Sequence[Assignment], units: Mapping[str, str]
) -> list[str]:
    """Tell covariates of which one table says the unit and another none that is known."""
    faults = []
    for item in assignments:
        if item.meaning is not ColumnMeaning.COVARIATE or item.column in units:
            continue
        known: tuple[str, str] | None = None
        without = ""
        for table in tables:
            column = table.column(item.column)
            if column is None or column.text is not None:
                continue
            unit = None if column.unit is None else parse_unit(column.unit)
            if unit is None:
                without = without or table.title
            elif (unit.dimension, unit.factor) != (Dimension.NONE, 1.0):
                known = known or (table.title, column.unit or "")
        if known and without:
            title, text = known
            faults.append(
                f"{without}: column {item.column!r} has no unit that is known, and in {title} it is in "
                f"{text}; say the unit of all with --unit '{item.column}={text}', or leave the column out "
                f"with --column 'ignored={item.column}'"
            )
    return faults


def contrary_units(tables: Sequence[Table], units: Mapping[str, str]) -> list[str]:
    """Tell columns of one name that are in one unit in one table and in another in the next."""
    first: dict[str, tuple[str, str]] = {}
    faults: dict[str, str] = {}
    for table in tables:
        for column in table.columns:
            unit = parse_unit(column.unit) if column.unit is not None else None
            if column.unit is None or unit is None or column.name in units:
                continue
            title, text = first.setdefault(column.name, (table.title, column.unit))
            before = parse_unit(text)
            if before is not None and replace(before, symbol=unit.symbol) != unit:
                faults.setdefault(
                    column.name,
                    f"column {column.name!r} is in {text} in {title} and in {column.unit} in {table.title}; "
                    f"import the files one by one, or say the unit of all with --unit '{column.name}={text}'",
                )
    return list(faults.values())
