"""Trees as few bytes, fast, and back to the same bits: MessagePack; an array is its shape and its bytes."""

from typing import Any, TypeVar

import msgspec
import numpy as np

from impactcell.serialization.tree import Tree, from_tree, to_tree

T = TypeVar("T")


def pack(value: object) -> bytes:
    """Write a dataclass; equal values give equal bytes.

    Raises
    ------
    TypeError
        It holds what cannot be written.
    """
    return pack_tree(to_tree(value))


def unpack(kind: type[T], data: bytes) -> T:
    """Read back what `pack` wrote for a value of class `kind`.

    Raises
    ------
    ValueError
        The bytes are not a `kind`, or of another version of it.
    """
    return from_tree(kind, unpack_tree(data))


def pack_tree(tree: Tree) -> bytes:
    """Write a tree.

    Raises
    ------
    TypeError
        It holds what cannot be written.
    """
    return _ENCODER.encode(tree)


def unpack_tree(data: bytes) -> Tree:
    """Read a tree.

    Raises
    ------
    ValueError
        The bytes are not what `pack_tree` wrote.
    """
    try:
        return _with_arrays(_DECODER.decode(data))
    except (msgspec.DecodeError, TypeError) as error:
        raise ValueError(f"damaged: {error}") from error


def plain_number(value: Any) -> Any:
    """Give a number of numpy as one of Python; for the encoders, of what they do not know.

    Raises
    ------
    TypeError
        It is none.
    """
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{getattr(value, 'dtype', '')} {type(value).__name__} has no stored form".lstrip())


def _encoded(value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        stored = value if value.dtype is _STORED else value.astype(_STORED)  # identity is the faster question
        return value.shape, stored.tobytes()
    return plain_number(value)


def _with_arrays(tree: Tree) -> Tree:
    """Make arrays of what they were written as; nothing else in a tree has bytes."""
    if isinstance(tree, dict):
        return {key: _with_arrays(value) for key, value in tree.items()}
    if not isinstance(tree, list):
        return tree
    if len(tree) == 2 and isinstance(tree[1], bytes):
        return np.frombuffer(tree[1], _STORED).astype(np.float64).reshape(tree[0])
    return [_with_arrays(value) for value in tree]


_STORED = np.dtype("<f8")
_ENCODER = msgspec.msgpack.Encoder(enc_hook=_encoded)
_DECODER = msgspec.msgpack.Decoder()
