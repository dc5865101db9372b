"""Frozen dataclasses to bytes and back, bit for bit, so that a restored state replays to the same bits.

Floats are written in hexadecimal (`float.hex`), arrays as their little-endian bytes in base64. What can
be written: dataclasses, floats, ints, bools, strings, None, enums, tuples, mappings with string keys
and numpy arrays, nested to any depth; each is restored to the type its annotation names.
"""

import base64
import dataclasses
import enum
import json
import types
import typing
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")

_PLAIN = frozenset({int, str, bool, type(None)})


@cache
def _field_names(kind: type) -> tuple[str, ...] | None:
    """Names of a dataclass's fields; None for any other class. A state has hundreds of them, each cycle."""
    return tuple(f.name for f in dataclasses.fields(kind)) if dataclasses.is_dataclass(kind) else None


def dumps(value: object) -> bytes:
    """Write a frozen dataclass as UTF-8 JSON; equal values give equal bytes."""
    return json.dumps(to_json(value), separators=(",", ":"), allow_nan=False).encode()


def loads(kind: type[T], data: bytes) -> T:
    """Read back what `dumps` wrote for a value of class `kind`.

    Raises
    ------
    ValueError
        The bytes are not a `kind`, or of another version of it.
    """
    try:
        restored: T = from_json(kind, json.loads(data))
    except (TypeError, KeyError, AttributeError) as error:
        raise ValueError(f"not a stored {kind.__name__}: {error}") from error
    return restored


def to_json(value: Any) -> Any:
    """Turn a value into mappings, lists, strings and integers."""
    kind: Any = type(value)
    if kind is float:
        return value.hex()
    if kind in _PLAIN:
        return value
    names = _field_names(kind)
    if names is not None:
        return {name: to_json(getattr(value, name)) for name in names}
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return float(value).hex()
    if isinstance(value, np.ndarray):
        raw = np.ascontiguousarray(value)
        raw = raw.astype(raw.dtype.newbyteorder("<"), copy=False)
        return {
            "dtype": raw.dtype.str,
            "shape": list(value.shape),
            "base64": base64.b64encode(raw.tobytes()).decode(),
        }
    if isinstance(value, tuple | list):
        return [to_json(item) for item in value]
    if isinstance(value, Mapping):
        return {str(key): to_json(item) for key, item in value.items()}
    raise TypeError(f"{type(value).__name__} has no exact written form")


def from_json(kind: Any, data: Any) -> Any:
    """Turn what `to_json` made back into a value of the annotated type `kind`."""
    origin = typing.get_origin(kind)
    if origin in (typing.Union, types.UnionType):
        return _from_union(kind, data)
    if origin is Sequence:
        return tuple(from_json(typing.get_args(kind)[0], item) for item in data)
    if origin is tuple:
        inner = typing.get_args(kind)
        if len(inner) == 2 and inner[1] is Ellipsis:
            return tuple(from_json(inner[0], item) for item in data)
        return tuple(from_json(part, item) for part, item in zip(inner, data, strict=True))
    if origin is not None and isinstance(origin, type) and issubclass(origin, Mapping):
        return {key: from_json(typing.get_args(kind)[1], item) for key, item in data.items()}
    if origin is np.ndarray:
        flat = np.frombuffer(base64.b64decode(data["base64"]), dtype=np.dtype(data["dtype"]))
        return flat.reshape(data["shape"]).astype(flat.dtype.newbyteorder("="))
    if isinstance(kind, type):
        return _from_class(kind, data)
    raise TypeError(f"cannot restore a {kind}")


def _from_class(kind: type, data: Any) -> Any:
    if dataclasses.is_dataclass(kind):
        hints = _hints(kind)
        if data.keys() != hints.keys():
            raise KeyError(f"{kind.__name__} holds {sorted(hints)}, not {sorted(data)}")
        return kind(**{name: from_json(hint, data[name]) for name, hint in hints.items()})
    if issubclass(kind, enum.Enum):
        return kind[data]
    if kind is float:
        return float.fromhex(data)
    if type(data) is not kind:
        raise TypeError(f"{data!r} is not {kind.__name__}")
    return data


def _from_union(kind: Any, data: Any) -> Any:
    members = typing.get_args(kind)
    if data is None and type(None) in members:
        return None
    sequences = tuple(m for m in members if _is_sequence(m))
    scalars = tuple(m for m in members if m is not type(None) and m not in sequences)
    (member,) = sequences if sequences and isinstance(data, list) else scalars
    return from_json(member, data)


def _is_sequence(kind: Any) -> bool:
    origin = typing.get_origin(kind)
    return isinstance(origin, type) and issubclass(origin, Sequence)


@cache
def _hints(kind: type) -> dict[str, Any]:
    hints = typing.get_type_hints(kind)
    return {f.name: hints[f.name] for f in dataclasses.fields(kind)}
