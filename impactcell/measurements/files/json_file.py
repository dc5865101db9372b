"""Reads JSON logs: a list of records, or lists of numbers by name, and what stands beside them."""

import json
from pathlib import Path
from typing import Any

from impactcell.errors import MeasurementError
from impactcell.measurements.files.arrays import tables_of
from impactcell.measurements.files.limits import Limits
from impactcell.measurements.table import Table


def read_json(path: Path, limits: Limits) -> tuple[Table, ...]:
    """Read the table of a JSON file: a list of records, or an object of lists of numbers.

    Raises
    ------
    MeasurementError
        It is no JSON, with the line, or holds no such table.
    """
    content = _load(path)
    attributes: dict[str, object] = {}
    columns: dict[str, list[Any]] = {}
    if isinstance(content, dict):
        attributes = {key: value for key, value in content.items() if isinstance(value, str | int | float)}
        lists = {key: value for key, value in content.items() if isinstance(value, list) and value}
        records = [value for value in lists.values() if all(isinstance(item, dict) for item in value)]
        if records:
            content = max(records, key=len)
        else:
            columns = _columns_of_lists(path, lists)
    if isinstance(content, list):
        columns = _columns_of_records(path, content, limits)
    limits.check_shape(str(path), max(map(len, columns.values()), default=0), len(columns))
    named = [(name, None, values) for name, values in columns.items()]
    tables = tables_of(str(path), named, attributes=attributes, note="JSON")
    if not tables:
        raise MeasurementError(f"{path}: holds no list of records or of numbers")
    return tuple(tables)


def _load(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8-sig"))
    except json.JSONDecodeError as error:
        raise MeasurementError(f"{path}:{error.lineno}: is not JSON: {error.msg}") from error
    except (UnicodeDecodeError, RecursionError, ValueError) as error:
        raise MeasurementError(f"{path}: is not JSON that is read: {error}") from error


def _columns_of_lists(path: Path, lists: dict[str, list[Any]]) -> dict[str, list[Any]]:
    """Columns by name, of an object of lists; one that begins with a record or a list is none."""
    columns = {key: values for key, values in lists.items() if not isinstance(values[0], dict | list)}
    for key, values in columns.items():
        place = next((n for n, value in enumerate(values, 1) if isinstance(value, dict | list)), None)
        if place is not None:
            raise MeasurementError(f"{path}: item {place} of {key!r} is no number; mend or remove it")
    return columns


def _columns_of_records(path: Path, items: list[Any], limits: Limits) -> dict[str, list[Any]]:
    """Columns by name, of a list of records; what a record lacks is None."""
    rows = [item for item in items if isinstance(item, dict)]
    strange = next((n for n, item in enumerate(items, 1) if not isinstance(item, dict)), None)
    if rows and strange is not None:
        raise MeasurementError(
            f'{path}: item {strange} of its {len(items)} is no record as `{{"time": 0.1}}` is; mend or '
            f"remove it"
        )
    names = list(dict.fromkeys(name for row in rows for name in row))
    limits.check_shape(str(path), len(rows), len(names))
    return {name: [_cell(row.get(name)) for row in rows] for name in names}


def _cell(value: Any) -> Any:
    return value if value is None or isinstance(value, str | int | float) else str(value)
