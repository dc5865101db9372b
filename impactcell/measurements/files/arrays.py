"""Arrays of a binary file as columns of a table."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from impactcell.measurements.notation.units import split_unit
from impactcell.measurements.table import MeasuredColumn, Table, unique_names

MAX_TEXT = 200
"""Characters of a property that are kept."""


def column_of(
    name: str, unit: str | None, values: Any, origin: np.datetime64 | None = None
) -> MeasuredColumn | None:
    """Give the column of an array of numbers, moments, durations or text; None for what is none of these.

    Moments become seconds from `origin`, else from the first, durations seconds; complex numbers are text.
    """
    try:
        array = np.asarray(values)
    except ValueError:  # lists among the numbers
        return None
    if array.ndim != 1 or not array.size:
        return None
    short = None if unit is None or not str(unit).strip() else str(unit).strip()
    if short is None:
        name, short = split_unit(name)
    begun = None
    if array.dtype.kind == "M":
        told = array[~np.isnat(array)]
        begun = origin if origin is not None else told[0] if told.size else array[0]
        array = array - begun
    if array.dtype.kind == "m":
        seconds = array / np.timedelta64(1, "ns") * 1e-9
        return MeasuredColumn(name, "s", np.asarray(seconds, dtype=np.float64), begun=begun)
    if array.dtype.kind in "biuf":
        return MeasuredColumn(name, short, np.ascontiguousarray(array, dtype=np.float64))
    if array.dtype.kind in "OSUc":
        try:
            numbers = np.array([np.nan if cell is None else float(cell) for cell in array.tolist()])
        except (TypeError, ValueError, OverflowError):
            cells = tuple(_word(cell) for cell in array.tolist())
            return MeasuredColumn(name, short, np.full(array.size, np.nan), cells)
        return MeasuredColumn(name, short, numbers)
    return None


def tables_of(
    source: str,
    columns: Sequence[tuple[str, str | None, Any]],
    group: str = "",
    attributes: Mapping[str, object] | None = None,
    note: str = "",
    origin: np.datetime64 | None = None,
    begun: np.datetime64 | None = None,
) -> list[Table]:
    """Give the tables of named arrays: those of one length share one, in order of appearance.

    Moments count from `origin`, where there is one; the seconds of the first array from `begun`.
    """
    by_length: dict[int, list[MeasuredColumn]] = {}
    for place, (name, unit, values) in enumerate(columns):
        column = column_of(name, unit, values, origin)
        if column is not None:
            if place == 0 and begun is not None:
                column = replace(column, begun=begun)
            by_length.setdefault(len(column.values), []).append(column)
    said = {str(key): _word(value)[:MAX_TEXT] for key, value in (attributes or {}).items()}
    tables = []
    for same in by_length.values():
        names = unique_names([column.name for column in same])
        renamed = tuple(replace(column, name=name) for name, column in zip(names, same, strict=True))
        tables.append(Table(source, renamed, group, said, (note,) if note else ()))
    return tables


def _word(value: object) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return "" if value is None else str(value)
