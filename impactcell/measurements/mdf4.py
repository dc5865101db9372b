"""Reads MDF files (ASAM) with asammdf; a channel group is a table with its own time."""

import logging
from pathlib import Path
from typing import Any

from impactcell.errors import MeasurementError
from impactcell.measurements.arrays import tables_of
from impactcell.measurements.limits import Limits
from impactcell.measurements.optional import reader_library
from impactcell.measurements.table import Table


def read_mdf4(path: Path, limits: Limits) -> tuple[Table, ...]:
    """Read the channels of each group, with its master channel as time.

    Raises
    ------
    MeasurementError
        It is too large, damaged, without channels, or asammdf is not installed.
    """
    asammdf = reader_library("asammdf", "MDF", path)
    logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # what it says there is raised here
    tables: list[Table] = []
    cells = 0
    try:
        with asammdf.MDF(path) as file:
            for number, group in enumerate(file.groups):
                count = group.channel_group.cycles_nr
                cells = limits.check_shape(f"{path}: group {number}", count, len(group.channels), cells)
            for number, group in enumerate(file.groups):
                tables += _group(file, number, group, path)
    except MeasurementError:
        raise
    except Exception as error:
        raise MeasurementError(f"{path}: is a damaged MDF file: {error}") from error
    if not tables:
        raise MeasurementError(f"{path}: holds no channel")
    return tuple(tables)


def _group(file: Any, number: int, group: Any, path: Path) -> list[Table]:
    columns: list[tuple[str, str | None, Any]] = []
    master = file.masters_db.get(number)
    for index, channel in enumerate(group.channels):
        if index == master:
            continue
        signal = file.get(group=number, index=index, raw=False)
        if not columns:
            columns.append(("time", "s", signal.timestamps))
        columns.append((channel.name, signal.unit or None, signal.samples))
    name = getattr(group.channel_group, "acq_name", "") or f"group {number}"
    return tables_of(str(path), columns, name, note=f"MDF {name}")
