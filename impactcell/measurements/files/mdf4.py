"""Reads MDF files (ASAM) with asammdf; a channel group is a table with its own time."""

import contextlib
import io
import logging
import traceback
from pathlib import Path
from typing import Any

import numpy as np

from impactcell.errors import MeasurementError
from impactcell.measurements.files.arrays import tables_of
from impactcell.measurements.files.limits import Limits
from impactcell.measurements.files.optional import reader_library
from impactcell.measurements.table import Table

_OPENED = ("_tempfile", "_mapped_file", "_file")
"""What asammdf's reader holds open."""


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
        _discard_half_made(error)
        raise MeasurementError(f"{path}: is a damaged MDF file: {error}") from error
    if not tables:
        raise MeasurementError(f"{path}: holds no channel")
    return tuple(tables)


def _discard_half_made(error: BaseException | None) -> None:
    """Close what asammdf was making when it failed: its destructor stumbles over what is not there yet.

    Python would tell that on standard error, of an object that nobody can reach but through the error.
    """
    while error is not None:
        for frame, _ in traceback.walk_tb(error.__traceback__):
            if not frame.f_globals.get("__name__", "").startswith("asammdf."):
                continue
            half_made: Any = frame.f_locals.get("self")
            parts: list[Any] = [getattr(half_made, name, None) for name in _OPENED]
            parts += [local for local in frame.f_locals.values() if isinstance(local, io.IOBase)]
            for part in parts:
                with contextlib.suppress(Exception):  # whatever it is, or has become
                    part.close()
            if hasattr(half_made, "__del__"):
                half_made._closed = True  # noqa: SLF001 - what its destructor looks at first
        error = error.__context__


def _group(file: Any, number: int, group: Any, path: Path) -> list[Table]:
    """Read the channels of a group; samples that are flagged invalid are nan at their times."""
    columns: list[tuple[str, str | None, Any]] = []
    left_out: list[str] = []
    master = file.masters_db.get(number)
    for index, channel in enumerate(group.channels):
        if index == master:
            continue
        signal = file.get(group=number, index=index, raw=False, ignore_invalidation_bits=True)
        if not columns:
            columns.append(("time", "s", signal.timestamps))
        samples = signal.samples
        if signal.invalidation_bits is not None and np.any(signal.invalidation_bits):
            invalid = np.asarray(signal.invalidation_bits, dtype=bool)
            samples = _without(samples, invalid)
            left_out.append(f", {channel.name}: {np.count_nonzero(invalid)} samples flagged invalid left out")
        columns.append((channel.name, signal.unit or None, samples))
    name = getattr(group.channel_group, "acq_name", "") or f"group {number}"
    note = f"MDF {name}{''.join(left_out)}"
    return tables_of(str(path), columns, name, note=note, begun=_start_of(file))


def _start_of(file: Any) -> np.datetime64 | None:
    """Moment of which the times of a file count, None where it says none."""
    nanoseconds = int(getattr(file.header, "abs_time", 0))
    return np.datetime64(nanoseconds, "ns") if nanoseconds else None


def _without(samples: Any, invalid: Any) -> Any:
    """Give samples with nothing in place of those that are invalid."""
    if samples.dtype.kind == "V":
        return samples  # records, which are no column
    is_number = samples.dtype.kind in "biuf"
    kept = samples.astype(np.float64 if is_number else object)
    kept[invalid] = np.nan if is_number else None
    return kept
