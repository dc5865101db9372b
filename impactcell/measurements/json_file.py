"""Reads JSON logs: a list of records, or lists of numbers by name, and what stands beside them."""

import json
from pathlib import Path
from typing import Any

from impactcell.errors import MeasurementError
from impactcell.measurements.arrays import tables_of
from impactcell.measurements.limits import Limits
from impactcell.measurements.table import Table


def read_json(path: Path, limits: Limits) -> tuple[Table, ...]:
    """Read the table of a JSON file: a list of records, or an object of lists of numbers.

    Raises
    ------
    MeasurementError
        It is no JSON, with the line, or holds no such table.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except json.JSONDecodeError as error:
        raise MeasurementError(f"{path}:{error.lineno}: is not JSON: {error.msg}") from error
    except (UnicodeDecodeError, RecursionError, ValueError) as error:
        raise MeasurementError(f"{path}: is not JSON that is read: {error}") from error
    said: dict[str, object] = {}
    columns: dict[str, list[Any]] = {}
    if isinstance(content, dict):
        said = {key: value for key, value in content.items() if isinstance(value, str | int | float)}
        lists = {key: value for key, value in content.items() if isinstance(value, list) and value}
        records = [value for value in lists.values() if all(isinstance(item, dict) for item in value)]
        if records:
            content = max(records, key=len)
        else:
            columns = {key: value for key, value in lists.items() if not isinstance(value[0], dict | list)}
            for key, values in columns.items():
                place = next((n for n, v in enumerate(values, 1) if isinstance(v, dict | list)), None)
                if place is not None:
                    raise MeasurementError(f"{path}: item {place} of {key!r} is no number; mend or remove it")
    if isinstance(content, list):
        rows = [item for item in content if isinstance(item, dict)]
        strange = next((n for n, item in enumerate(content, 1) if not isinstance(item, dict)), None)
        if rows and strange is not None:
            raise MeasurementError(
                f'{path}: item {strange} of its {len(content)} is no record as `{{"time": 0.1}}` is; mend or '
                f"remove it"
            )
        names = list(dict.fromkeys(name for row in rows for name in row))
        limits.check_shape(str(path), len(rows), len(names))
        columns = {name: [_cell(row.get(name)) for row in rows] for name in names}
    limits.check_shape(str(path), max(map(len, columns.values()), default=0), len(columns))
    tables = tables_of(str(path), [(n, None, v) for n, v in columns.items()], attributes=said, note="JSON")
    if not tables:
        raise MeasurementError(f"{path}: holds no list of records or of numbers")
    return tuple(tables)


def _cell(value: Any) -> Any:
    return value if value is None or isinstance(value, str | int | float) else str(value)
