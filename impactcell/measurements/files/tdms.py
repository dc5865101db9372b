"""Reads TDMS files of LabVIEW with npTDMS; a group is a table."""

from pathlib import Path
from typing import Any

from impactcell.errors import MeasurementError
from impactcell.measurements.files.arrays import tables_of
from impactcell.measurements.files.limits import Limits
from impactcell.measurements.files.optional import damage_told, reader_library
from impactcell.measurements.files.tdms_clocks import by_clock, origins
from impactcell.measurements.table import Table

UNIT_KEYS = ("unit_string", "NI_UnitDescription", "unit", "Unit")
"""Properties that hold the unit of a channel."""


def read_tdms(path: Path, limits: Limits) -> tuple[Table, ...]:
    """Read the channels of each group; time from the waveforms' increments where there are such.

    Channels of one group that begin or go by steps of their own are a table each.

    Raises
    ------
    MeasurementError
        It is too large, damaged, without channels, a channel does not say when it begins where others do,
        or npTDMS is not installed.
    """
    nptdms = reader_library("nptdms", "TDMS", path)
    tables: list[Table] = []
    cells = 0
    with damage_told(path, "TDMS"), path.open("rb") as opened, nptdms.TdmsFile.open(opened) as file:
        cut = ", cut off: what follows its last whole chunk is lost" if _is_cut_off(file) else ""
        groups = file.groups()
        for group in groups:
            limits.check_shape(f"{path}: {group.name}", 0, len(group.channels()))
            for channel in group.channels():
                cells = limits.check_shape(f"{path}: {group.name}", len(channel), 1, cells)
        for group, origin in zip(groups, origins(path, groups), strict=True):
            said = {**file.properties, **group.properties}
            note = f"TDMS group {group.name}{cut}"
            for time, same in by_clock(group.channels(), origin):
                columns = [*time, *((channel.name, _unit(channel), channel[:]) for channel in same)]
                begun = origin if time else None
                tables += tables_of(str(path), columns, group.name, said, note, origin, begun)
    if not tables:
        raise MeasurementError(f"{path}: holds no channel")
    return tuple(tables)


def _is_cut_off(file: Any) -> bool:
    """Whether the file ends within a segment, as after a crash of what wrote it."""
    return bool(file.file_status.incomplete_final_segment)


def _unit(channel: Any) -> str | None:
    return next((str(channel.properties[key]) for key in UNIT_KEYS if key in channel.properties), None)
