"""Reads MATLAB files up to version 7.2 with scipy; those of 7.3 are HDF5."""

import zlib
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy.io import loadmat, whosmat

from impactcell.errors import MeasurementError
from impactcell.measurements.files.arrays import tables_of
from impactcell.measurements.files.limits import Limits
from impactcell.measurements.files.optional import damage_told
from impactcell.measurements.table import Table

HEADER_BYTES, COMPRESSED = 128, 15
"""Header of a file of version 5, and the type of a data element that is compressed with zlib (MAT-file
format)."""
CHUNK_BYTES = 1 << 20
"""Bytes unpacked at a time."""
UNITS = ("units", "unit")
"""Structures that hold the units of what stands beside them."""
SCALAR = (str, float, int, np.generic)
"""What says something of all vectors beside it."""


def read_matlab(path: Path, limits: Limits) -> tuple[Table, ...]:
    """Read the vectors of a MATLAB file, and those in its structures: a table for each structure.

    Raises
    ------
    MeasurementError
        It is too large, damaged, or holds no vector of numbers.
    """
    with damage_told(path, "MATLAB"):
        _check_unpacked(path, limits)
        cells = 0
        for name, shape, _ in whosmat(path):
            cells = limits.check_shape(f"{path}: {name}", max(shape, default=0), _width(shape), cells)
        content = loadmat(path, squeeze_me=True, struct_as_record=False, chars_as_strings=True)
    content = {name: value for name, value in content.items() if not name.startswith("__")}
    tables = _tables(path, content, "", limits, {})
    if not tables:
        raise MeasurementError(f"{path}: holds no vector of numbers")
    return tuple(tables)


def _check_unpacked(path: Path, limits: Limits) -> None:
    """Refuse what unpacks to too much, also within structures, whose sizes are not told beforehand."""
    unpacked = 0
    with path.open("rb") as file:
        header = file.read(HEADER_BYTES)
        order: Literal["little", "big"] = "little" if header[126:128] == b"IM" else "big"
        if not header.startswith(b"MATLAB"):
            return
        while len(tag := file.read(8)) == 8:
            kind, size = int.from_bytes(tag[:4], order), int.from_bytes(tag[4:], order)
            if kind != COMPRESSED:
                file.seek(size, 1)
                continue
            inflate = zlib.decompressobj()
            pending = file.read(size)
            while pending:
                unpacked += len(inflate.decompress(pending, CHUNK_BYTES))
                pending = inflate.unconsumed_tail
                if unpacked > limits.unpacked_bytes:
                    raise MeasurementError(
                        f"{path}: unpacks to more than the {limits.unpacked_bytes / 1e6:.0f} MB that are read"
                    )


def _width(shape: tuple[int, ...]) -> int:
    size = int(np.prod(shape, dtype=np.float64))
    return -(-size // max(*shape, 1)) if shape else 1


def _tables(
    path: Path, content: Mapping[str, Any], group: str, limits: Limits, around: Mapping[str, object]
) -> list[Table]:
    columns: list[tuple[str, str | None, Any]] = []
    tables: list[Table] = []
    said = {**around, **_scalars(content)}
    units = _units(content)
    for name, value in content.items():
        fields = _fields(value)
        if fields is not None:
            if group.count(".") < 4:
                tables += _tables(path, fields, f"{group}.{name}".strip("."), limits, said)
        elif isinstance(value, np.ndarray) and value.dtype.kind == "O":
            for place, item in enumerate(value.ravel()[: limits.files].tolist(), 1):
                inner = _fields(item)
                if inner is not None:
                    tables += _tables(path, inner, f"{group}.{name}({place})".strip("."), limits, said)
        elif isinstance(value, np.ndarray) and value.ndim in (1, 2) and value.size:
            columns += _columns(name, value, units)
    limits.check_shape(str(path), 0, len(columns))
    tables += _cell_tables(path, content, group, said)
    own = tables_of(str(path), columns, group, said, "MATLAB")
    for table in own:
        limits.check_shape(str(path), len(table), len(table.columns))
    return own + tables


def _units(content: Mapping[str, Any]) -> object:
    return next((content[name] for name in UNITS if name in content), None)


def _scalars(content: Mapping[str, Any]) -> dict[str, object]:
    """Give what scalars say, with their units, and those of structures that hold nothing else.

    Where several of these have a scalar of one name, it is called by its structure, too.
    """
    units = _fields(_units(content)) or {}
    said: dict[str, object] = {
        name: f"{value} {units.get(name, '')}".strip()
        for name, value in content.items()
        if isinstance(value, SCALAR)
    }
    beside = {
        name: _scalars(fields)
        for name, value in content.items()
        if (fields := _fields(value)) is not None and name not in UNITS and _is_flat(fields)
    }
    names = Counter(name for inner in (said, *beside.values()) for name in inner)
    for structure, inner in beside.items():
        said |= {name if names[name] == 1 else f"{structure}.{name}": value for name, value in inner.items()}
    return said


def _is_flat(fields: Mapping[str, Any]) -> bool:
    """Whether a structure holds scalars alone, or structures that do."""
    inner = [_fields(value) for value in fields.values()]
    return all(
        isinstance(value, SCALAR) if within is None else _is_flat(within)
        for value, within in zip(fields.values(), inner, strict=True)
    )


def _cell_tables(
    path: Path, content: Mapping[str, Any], group: str, said: Mapping[str, object]
) -> list[Table]:
    """Give a table for each place in cell arrays of vectors; cell arrays of one length belong together."""
    by_length: dict[int, dict[str, list[Any]]] = {}
    for name, value in content.items():
        if isinstance(value, np.ndarray) and value.dtype.kind == "O":
            items = value.ravel().tolist()
            if items and all(isinstance(item, np.ndarray) and item.ndim in (1, 2) for item in items):
                by_length.setdefault(len(items), {})[name] = items
    tables: list[Table] = []
    for length, cells in by_length.items():
        for place in range(length):
            columns = [c for name, items in cells.items() for c in _columns(name, items[place], None)]
            tables += tables_of(
                str(path), columns, f"{group} {place + 1}".strip(), said, f"MATLAB cell {place + 1}"
            )
    return tables


def _columns(name: str, value: "np.ndarray[Any, Any]", units: object) -> list[tuple[str, str | None, Any]]:
    fields = _fields(units)
    unit = str(fields[name]) if fields and name in fields else None
    if value.ndim == 1:
        return [(name, unit, value)]
    across = value if value.shape[0] >= value.shape[1] else value.T
    return [(f"{name} {i + 1}", unit, across[:, i]) for i in range(across.shape[1])]


def _fields(value: object) -> dict[str, Any] | None:
    names = getattr(value, "_fieldnames", None)
    return None if names is None else {name: getattr(value, name) for name in names}
