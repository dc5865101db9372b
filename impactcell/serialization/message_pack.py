"""Frozen dataclasses as few bytes and fast, and back to the same bits: for a state, written every cycle.

MessagePack with the names of the fields; arrays of floats are their shape and their bytes.
`impactcell.serialization.json_text` writes the same to be read by people.
"""

from functools import cache
from typing import Any, TypeVar

import msgspec
import numpy as np

T = TypeVar("T")


def pack(value: object) -> bytes:
    """Write a dataclass; equal values give equal bytes.

    Raises
    ------
    TypeError
        It holds what cannot be written.
    """
    return _ENCODER.encode(value)


def unpack(kind: type[T], data: bytes) -> T:
    """Read back what `pack` wrote for a value of class `kind`.

    Raises
    ------
    ValueError
        The bytes are not a `kind`, or of another version of it.
    """
    wanted: Any = kind
    try:
        value: T = _decoder(wanted).decode(data)
    except msgspec.DecodeError as error:
        raise ValueError(f"not a stored {kind.__name__}: {error}") from error
    # a field that is not there would get its default, and one that is not known be passed over
    if _names(msgspec.msgpack.decode(data)) != _names(msgspec.msgpack.decode(pack(value))):
        raise ValueError(f"not a stored {kind.__name__}: its fields are others")
    return value


def _plain(value: Any) -> Any:
    """Give what msgspec does not know as something that it does."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        return value.shape, value.astype("<f8", copy=False).tobytes()
    raise TypeError(f"{getattr(value, 'dtype', '')} {type(value).__name__} has no packed form".lstrip())


def _array(_: Any, plain: Any) -> Any:
    shape, data = plain
    return np.frombuffer(data, "<f8").astype(np.float64).reshape(shape)


_ENCODER = msgspec.msgpack.Encoder(enc_hook=_plain)


@cache
def _decoder(kind: Any) -> msgspec.msgpack.Decoder[Any]:
    return msgspec.msgpack.Decoder(kind, dec_hook=_array)


def _names(plain: Any) -> Any:
    """Names of all fields as they are nested, without what they hold."""
    if isinstance(plain, dict):
        return {name: _names(value) for name, value in plain.items()}
    if isinstance(plain, list):
        return [_names(value) for value in plain]
    return None
