"""Reads HDF5 files, and MATLAB files of version 7.3, which are such, with h5py."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from impactcell.errors import MeasurementError
from impactcell.measurements.columns.sampling_step import says_step
from impactcell.measurements.files.arrays import tables_of
from impactcell.measurements.files.limits import Limits
from impactcell.measurements.files.optional import damage_told, reader_library
from impactcell.measurements.notation.natural_order import natural_key
from impactcell.measurements.table import Table

Column = tuple[str, str | None, Any]
"""Name, unit and values."""
Clock = tuple[tuple[str, str], ...]
"""Attribute that says how often a data set was sampled, and its value; empty where none does."""

MAX_DEPTH = 8
"""Groups within groups that are looked into."""
UNIT_KEYS = ("unit", "units", "Unit", "Units", "Einheit", "unit_string")
"""Attributes that hold the unit of a data set."""
SCALE, OFFSET, FILLS = "scale_factor", "add_offset", ("_FillValue", "missing_value")
"""Attributes of a data set that is packed as the CF conventions of netCDF have it."""


def read_hdf5(path: Path, limits: Limits) -> tuple[Table, ...]:
    """Read a table of each group: its vectors, the columns of its matrices and of its records.

    What attributes and scalars of a group say holds for the groups within, unless these say otherwise. Groups
    come in the order of their names, `shot10` after `shot9`.

    Raises
    ------
    MeasurementError
        It is too large, damaged, without data, or h5py is not installed.
    """
    h5py = reader_library("h5py", "HDF5", path)
    tables: list[Table] = []
    with damage_told(path, "HDF5"), h5py.File(path, "r") as file:
        _read_group(h5py, file, path, limits, (0, 0), {}, tables)
    if not tables:
        raise MeasurementError(f"{path}: holds no column of numbers")
    return tuple(tables)


def _read_group(
    h5py: Any,
    group: Any,
    path: Path,
    limits: Limits,
    spent: tuple[int, int],
    around: Mapping[str, object],
    tables: list[Table],
) -> int:
    """Read the tables of a group and of those within; the cells read so far."""
    depth, cells = spent
    columns: list[tuple[Clock, Column]] = []
    told: list[str] = []
    names = [
        name
        for name in sorted(group, key=natural_key)
        # links may lead out of the file, or round in a circle; # is MATLAB's own
        if isinstance(group.get(name, getlink=True), h5py.HardLink) and not name.startswith("#")
    ]
    items = {name: group[name] for name in names}
    said = {**around, **_said_in(h5py, group, items)}
    for name, item in items.items():
        if isinstance(item, h5py.Group):
            if depth < MAX_DEPTH:
                cells = _read_group(h5py, item, path, limits, (depth + 1, cells), said, tables)
        elif isinstance(item, h5py.Dataset):
            cells = _count(item, path, limits, cells)
            clock = _clock(item)
            columns += [(clock, column) for column in _columns(h5py, name, item, path, told)]
    limits.check_shape(f"{path}: {group.name}", 0, len(columns))
    note = "HDF5" if group.name == "/" else f"HDF5 group {group.name}"
    for clock, same in _by_clock(columns):
        of_these = dict(clock) | {key: value for key, value in said.items() if key not in dict(clock)}
        tables += tables_of(str(path), same, group.name.strip("/"), of_these, "".join([note, *told]))
    return cells


def _clock(item: Any) -> Clock:
    """Give the attribute of a data set that says its rate or step, if one does."""
    said = ((key, str(_plain(value))) for key, value in item.attrs.items())
    return next((((key, text),) for key, text in said if says_step(key, text)), ())


def _by_clock(columns: list[tuple[Clock, Column]]) -> Iterator[tuple[Clock, list[Column]]]:
    """Give columns of one length that share their rate; those that say none go with the others' only one."""
    for length in dict.fromkeys(len(column[2]) for _, column in columns):
        same = [(clock, column) for clock, column in columns if len(column[2]) == length]
        clocks = dict.fromkeys(clock for clock, _ in same)
        told = [clock for clock in clocks if clock]
        if len(told) < 2:
            yield told[0] if told else (), [column for _, column in same]
        else:
            for clock in clocks:
                yield clock, [column for own, column in same if own == clock]


def _said_in(h5py: Any, group: Any, items: Mapping[str, Any]) -> dict[str, object]:
    """Give what attributes and scalars of a group say, scalars with their unit."""
    said = {key: _plain(value) for key, value in group.attrs.items()}
    for name, item in items.items():
        if not isinstance(item, h5py.Dataset) or item.shape != () or not _is_plain(h5py, item):
            continue
        if item.dtype.names is None:
            said[name] = f"{_plain(item[()])} {_unit_of(item) or ''}".strip()
    return said


def _count(item: Any, path: Path, limits: Limits, cells: int) -> int:
    """Refuse a data set by its shape, before it is unpacked."""
    if item.ndim not in (1, 2) or not item.size:
        return cells
    width = len(item.dtype.names) if item.dtype.names else min(item.shape) if item.ndim == 2 else 1
    return limits.check_shape(
        f"{path}: {item.name}", item.size // max(width, 1) if item.ndim == 2 else item.size, width, cells
    )


def _is_plain(h5py: Any, item: Any) -> bool:
    """Whether a data set holds numbers or text: no references, as of MATLAB's cells, nor lists in its cells.

    What MATLAB marks as empty holds a shape.
    """
    is_text = h5py.check_string_dtype(item.dtype) is not None
    return (is_text or not item.dtype.hasobject) and "MATLAB_empty" not in item.attrs


def _columns(h5py: Any, name: str, item: Any, path: Path, told: list[str]) -> list[Column]:
    unit = _unit_of(item)
    if not item.size or item.ndim not in (1, 2) or not _is_plain(h5py, item):
        return []
    if _plain(item.attrs.get("MATLAB_class")) == "char" and item.ndim == 2:
        return [(name, unit, ["".join(map(chr, word)).strip() for word in item[()].T.tolist()])]
    if item.dtype.names:
        records = item[()]
        return [(field, unit, records[field]) for field in item.dtype.names if records[field].ndim == 1]
    values = item.asstr()[()] if item.dtype.kind == "O" else _unpacked(item, path, told)
    if values.ndim == 1:
        return [(name, unit, values)]
    if values.shape[0] < values.shape[1]:
        values = values.T  # MATLAB writes columns as rows
    if values.shape[1] == 1:
        return [(name, unit, values[:, 0])]
    names = _plain(item.attrs.get("columns", item.attrs.get("names")))
    titles = names if isinstance(names, list) and len(names) == values.shape[1] else None
    return [
        (titles[i] if titles else f"{name} {i + 1}", unit, np.ascontiguousarray(values[:, i]))
        for i in range(values.shape[1])
    ]


def _unit_of(item: Any) -> str | None:
    return next((str(_plain(item.attrs[key])) for key in UNIT_KEYS if key in item.attrs), None)


def _unpacked(item: Any, path: Path, told: list[str]) -> Any:
    """Give raw * scale_factor + add_offset of a data set, nan where raw is one of its fills; tell of that."""
    raw = item[()]
    if raw.dtype.kind not in "iuf":
        return raw
    values, place, name = raw, f"{path}: {item.name}", item.name.rpartition("/")[2]
    if SCALE in item.attrs:
        scale = _number(place, SCALE, item.attrs[SCALE])
        values = values * np.float64(scale)
        told.append(f", {name} by its {SCALE} {scale:g}")
    if OFFSET in item.attrs:
        offset = _number(place, OFFSET, item.attrs[OFFSET])
        values = values + np.float64(offset)
        told.append(f", {name} by its {OFFSET} {offset:g}")
    for key in FILLS:
        fills = np.ravel(item.attrs.get(key, ()))
        if not fills.size or fills.dtype.kind not in "iuf":
            continue
        empty = np.isin(raw, fills.astype(raw.dtype) if raw.dtype.kind == "f" else fills)
        if empty.any():
            values = np.where(empty, np.nan, values)
            told.append(f", {name}: {np.count_nonzero(empty)} values left out by its {key}")
    return values


def _number(place: str, key: str, said: Any) -> float:
    number = np.ravel(said)
    if number.size == 1 and number.dtype.kind in "iuf" and np.isfinite(number[0]):
        return float(number[0])
    raise MeasurementError(
        f"{place}: its {key} is {str(_plain(said))[:40]!r}, where one number is needed; correct it, or apply "
        f"it and remove the attribute"
    )


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, np.ndarray):
        return [_plain(item) for item in value.ravel()[:1000].tolist()]
    return value
