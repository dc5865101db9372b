"""Trees as JSON, and back to the same bits: for what people may look at.

Floats have as many digits as tell them from all others (`repr`); NaN and Infinity are written so, as Python
and SQLite read them. An array is its shape and its bytes in base64.
"""

import binascii
import json
from typing import Any, Final, TypeVar

import numpy as np

from impactcell.serialization.message_pack import plain_number
from impactcell.serialization.tree import Tree, from_tree, to_tree

T = TypeVar("T")

_SHAPE: Final = "array of"
"""Key of an array's shape: no field can have this name."""
_BYTES: Final = "base64"
_FLOATS: Final = np.dtype("<f8")


def dumps(value: object) -> str:
    """Write a dataclass; equal values give equal text.

    Raises
    ------
    TypeError
        It holds what cannot be written.
    """
    return dump_tree(to_tree(value))


def loads(kind: type[T], text: str) -> T:
    """Read back what `dumps` wrote for a value of class `kind`.

    Raises
    ------
    ValueError
        The text is not a `kind`, or of another version of it.
    """
    return from_tree(kind, load_tree(text))


def dump_tree(tree: Tree) -> str:
    """Write a tree.

    Raises
    ------
    TypeError
        It holds what cannot be written.
    """
    return json.dumps(tree, default=_encoded, ensure_ascii=False, separators=(",", ":"))


def load_tree(text: str) -> Tree:
    """Read a tree.

    Raises
    ------
    ValueError
        The text is not what `dump_tree` wrote.
    """
    return json.loads(text, object_hook=_decoded)


def _encoded(value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        stored = binascii.b2a_base64(value.astype(_FLOATS).tobytes(), newline=False)
        return {_SHAPE: value.shape, _BYTES: stored.decode()}
    return plain_number(value)


def _decoded(tree: dict[str, Tree]) -> Tree:
    if tree.keys() != {_SHAPE, _BYTES}:
        return tree
    stored = binascii.a2b_base64(tree[_BYTES])
    return np.frombuffer(stored, _FLOATS).astype(np.float64).reshape(tree[_SHAPE])
