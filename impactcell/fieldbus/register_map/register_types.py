"""Types, units and tables of the values that a register map describes."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from impactcell.records import MM_PER_MIN

WIRE: Final = np.dtype(">u2")
"""One register as Modbus carries it."""

BIT_TABLES: Final = ("coil", "discrete")
"""Tables of single bits: coils (functions 1, 5 and 15), and discrete inputs (function 2)."""
TABLES: Final = ("holding", "input", *BIT_TABLES)
"""The four tables of Modbus: holding registers and input registers, coils and discrete inputs."""
WRITABLE_TABLES: Final = ("holding", "coil")
"""Those that a client can write."""

SI_FACTOR: Final[Mapping[str, float]] = {
    "1": 1.0,
    "m": 1.0,
    "mm": 1e-3,
    "um": 1e-6,
    "nm": 1e-9,
    "m/s": 1.0,
    "mm/s": 1e-3,
    "mm/min": MM_PER_MIN,
    "N": 1.0,
    "mN": 1e-3,
    "kN": 1e3,
    "kg": 1.0,
    "g": 1e-3,
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "ns": 1e-9,
    "Hz": 1.0,
    "kHz": 1e3,
}
"""Units a map may use, and how many SI units one of them is."""

KINDS: Final[Mapping[str, np.dtype[Any]]] = {
    "u16": np.dtype(">u2"),
    "i16": np.dtype(">i2"),
    "u32": np.dtype(">u4"),
    "i32": np.dtype(">i4"),
    "u64": np.dtype(">u8"),
    "i64": np.dtype(">i8"),
    "bcd16": np.dtype(">u2"),
    "bcd32": np.dtype(">u4"),
    "f32": np.dtype(">f4"),
    "f64": np.dtype(">f8"),
    "bit": WIRE,
}
"""Numeric types of a register; `string` is the other one. A `bit` is a coil or a discrete input: in blocks of
words it is one of them, 0 or 1."""


def code_range(kind: str) -> tuple[int, int] | None:
    """Return the least and the largest code of a type; None of floating-point numbers and of text.

    >>> code_range("i16"), code_range("bcd16"), code_range("f32")
    ((-32768, 32767), (0, 9999), None)
    """
    if kind == "bit":
        return 0, 1
    if kind == "string" or KINDS[kind].kind == "f":
        return None
    if kind.startswith("bcd"):
        return 0, 10 ** (2 * KINDS[kind].itemsize) - 1
    limits = np.iinfo(KINDS[kind])
    return int(limits.min), int(limits.max)
