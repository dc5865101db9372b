"""Reads Parquet files with pyarrow; their sizes are known before anything is unpacked."""

from pathlib import Path
from typing import Any

import numpy as np

from impactcell.errors import MeasurementError
from impactcell.measurements.files.arrays import tables_of
from impactcell.measurements.files.limits import Limits
from impactcell.measurements.files.optional import reader_library
from impactcell.measurements.table import Table


def read_parquet(path: Path, limits: Limits) -> tuple[Table, ...]:
    """Read the columns of a Parquet file; a unit is the field's metadata `unit`, or stands in its name.

    Raises
    ------
    MeasurementError
        It is too large, damaged, without rows, or pyarrow is not installed.
    """
    library = reader_library("pyarrow.parquet", "Parquet", path)
    try:
        with library.ParquetFile(path) as file:
            metadata = file.metadata
            limits.check_shape(str(path), metadata.num_rows, metadata.num_columns)
            data = file.read()
    except MeasurementError:
        raise
    except Exception as error:
        raise MeasurementError(f"{path}: is a damaged Parquet file: {_first_line(error)}") from error
    if not data.num_rows:
        raise MeasurementError(f"{path}: has no rows")
    columns = [(field.name, _unit(field), _values(data.column(i))) for i, field in enumerate(data.schema)]
    said = {
        key.decode("utf-8", "replace"): value
        for key, value in (data.schema.metadata or {}).items()
        if key not in (b"pandas", b"ARROW:schema")
    }
    return tuple(tables_of(str(path), columns, attributes=said, note="Parquet"))


def _unit(field: Any) -> str | None:
    said = field.metadata or {}
    for key in (b"unit", b"units", b"Unit"):
        if key in said:
            return str(said[key].decode("utf-8", "replace"))
    return None


def _values(column: Any) -> Any:
    values = column.to_numpy()
    return values if isinstance(values, np.ndarray) else np.asarray(values)


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__
