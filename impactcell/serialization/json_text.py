"""Frozen dataclasses as JSON with names, and back to the same bits: for what people may look at.

Floats are written in hexadecimal (`float.hex`), arrays as their little-endian bytes in base64. What can
be written: dataclasses, floats, ints, bools, strings, None, enums, tuples, mappings with string keys
and numpy arrays, nested to any depth; each is restored to the type its annotation names.
"""

import base64
import binascii
import dataclasses
import enum
import json
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")


_quoted = json.encoder.encode_basestring_ascii


@cache
def _fields(kind: type) -> tuple[tuple[str, str], ...] | None:
    """Name of each of a dataclass's fields and what stands before its value; None for any other class."""
    if not dataclasses.is_dataclass(kind):
        return None
    names = [field.name for field in dataclasses.fields(kind)]
    return tuple((name, f'{"," if i else "{"}"{name}":') for i, name in enumerate(names))


def dumps(value: object) -> bytes:
    """Write a frozen dataclass as UTF-8 JSON; equal values give equal bytes."""
    parts: list[str] = []
    _write(value, parts.append)
    return "".join(parts).encode()


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


def _write(value: Any, add: Callable[[str], None]) -> None:
    """Add a value's JSON piece by piece: a state has a thousand of them, each cycle."""
    kind: Any = type(value)
    if kind is float:
        add(f'"{value.hex()}"')
    elif kind is str:
        add(_quoted(value))
    elif value is None or kind is bool:
        add(_WORDS[value])
    elif kind is int:
        add(str(value))
    elif (fields := _fields(kind)) is not None:
        for name, before in fields:
            add(before)
            _write(getattr(value, name), add)
        add("}" if fields else "{}")
    elif isinstance(value, enum.Enum):
        add(_quoted(value.name))
    elif isinstance(value, np.ndarray):
        raw = np.ascontiguousarray(value)
        raw = raw.astype(raw.dtype.newbyteorder("<"), copy=False)
        text = binascii.b2a_base64(raw.tobytes(), newline=False).decode()
        shape = ",".join(map(str, value.shape))
        add(f'{{"dtype":"{raw.dtype.str}","shape":[{shape}],"base64":"{text}"}}')
    elif isinstance(value, tuple | list):
        add("[")
        for i, item in enumerate(value):
            if i:
                add(",")
            _write(item, add)
        add("]")
    elif isinstance(value, Mapping):
        add("{")
        for i, (key, item) in enumerate(value.items()):
            add(f"{',' if i else ''}{_quoted(str(key))}:")
            _write(item, add)
        add("}")
    elif isinstance(value, float):
        add(f'"{float(value).hex()}"')
    elif isinstance(value, int | str):
        add(json.dumps(value))
    else:
        raise TypeError(f"{kind.__name__} has no exact written form")


_WORDS = {None: "null", True: "true", False: "false"}


def from_json(kind: Any, data: Any) -> Any:
    """Turn parsed JSON back into a value of the annotated type `kind`."""
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
