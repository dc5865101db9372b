"""Reads TDMS files of LabVIEW with npTDMS; a group is a table."""

from pathlib import Path
from typing import Any

import numpy as np

from impactcell.errors import MeasurementError
from impactcell.measurements.arrays import tables_of
from impactcell.measurements.limits import Limits
from impactcell.measurements.optional import damage_told, reader_library
from impactcell.measurements.table import Table

UNIT_KEYS = ("unit_string", "NI_UnitDescription", "unit", "Unit")
"""Properties that hold the unit of a channel."""


def read_tdms(path: Path, limits: Limits) -> tuple[Table, ...]:
    """Read the channels of each group; time from the waveform's increment where there is one.

    Raises
    ------
    MeasurementError
        It is too large, damaged, without channels, or npTDMS is not installed.
    """
    nptdms = reader_library("nptdms", "TDMS", path)
    tables: list[Table] = []
    cells = 0
    with damage_told(path, "TDMS"), path.open("rb") as opened, nptdms.TdmsFile.open(opened) as file:
        cut = ", cut off: what follows its last whole chunk is lost" if _is_cut_off(file) else ""
        for group in file.groups():
            channels = group.channels()
            limits.check_shape(f"{path}: {group.name}", 0, len(channels))
            for channel in channels:
                cells = limits.check_shape(f"{path}: {group.name}", len(channel), 1, cells)
            columns = [(channel.name, _unit(channel), channel[:]) for channel in channels if len(channel)]
            columns = [*_times(channels), *columns]
            said = {**file.properties, **group.properties}
            tables += tables_of(str(path), columns, group.name, said, f"TDMS group {group.name}{cut}")
    if not tables:
        raise MeasurementError(f"{path}: holds no channel")
    return tuple(tables)


def _is_cut_off(file: Any) -> bool:
    """Whether the file ends within a segment, as after a crash of what wrote it."""
    return bool(file.file_status.incomplete_final_segment)


def _unit(channel: Any) -> str | None:
    return next((str(channel.properties[key]) for key in UNIT_KEYS if key in channel.properties), None)


def _times(channels: list[Any]) -> list[tuple[str, str | None, Any]]:
    """Time of each length of waveform, where none of that length is a channel of its own."""
    times: dict[int, tuple[str, str | None, Any]] = {}
    for channel in channels:
        step = channel.properties.get("wf_increment")
        if step and len(channel) and len(channel) not in times:
            offset = float(channel.properties.get("wf_start_offset", 0.0))
            times[len(channel)] = ("time", "s", offset + float(step) * np.arange(len(channel)))
    return list(times.values())
