"""How the fields of a dataclass are stored: under which key, and as what."""

import dataclasses
import enum
import types
import typing
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

_KEY, _MEMBERS = "stored key", "stored by"


def stored(*, key: str | None = None, by: tuple[str, ...] | None = None) -> Mapping[str, Any]:
    """Metadata of a field: `field(metadata=stored(...))`.

    Parameters
    ----------
    key : str, optional
        Stored instead of the field's name; it stays when the field is renamed.
    by : tuple of str, optional
        The field is a tuple with one item for each of these names, in their order: they are stored by name
        instead of by place, so that a name more or less does no harm.
    """
    return types.MappingProxyType({_KEY: key, _MEMBERS: by})


@dataclasses.dataclass(frozen=True, slots=True)
class StoredField:
    """A field of a dataclass: its name, its stored key, its annotation, and the names it is stored by."""

    name: str
    key: str
    hint: Any
    members: tuple[str, ...] | None


@cache
def fields_of(kind: type) -> tuple[StoredField, ...]:
    """List the stored fields of a dataclass, in their order."""
    hints = typing.get_type_hints(kind)
    return tuple(
        StoredField(f.name, f.metadata.get(_KEY) or f.name, hints[f.name], f.metadata.get(_MEMBERS))
        for f in dataclasses.fields(kind)
    )


def described(hint: Any) -> Any:
    """Describe the stored form of a type without the name of any class: what a test pins.

    >>> from impactcell.records import Summary
    >>> described(Summary)  # doctest: +NORMALIZE_WHITESPACE
    {'peak_force_n': 'float', 'sliding_distance_m': 'float', 'peak_force_std_n': 'float',
     'sliding_distance_std_m': 'float'}
    """
    if is_dataclass(hint):
        return {f.key: _described_field(f) for f in fields_of(hint)}
    if members := union_members(hint):
        return {"either": [described(member) for member in members]}
    if is_sequence(hint):
        return [described(item) for item in items_of(hint)]
    if is_mapping(hint):
        return {"any text": described(typing.get_args(hint)[1])}
    if is_array(hint):
        return "array of float"
    if is_enum(hint):
        return {"one of": [member.value for member in hint]}
    return "nothing" if hint is type(None) else "..." if hint is Ellipsis else hint.__name__


def _described_field(field: StoredField) -> Any:
    if field.members is None:
        return described(field.hint)
    # which names there are is not pinned: one more or less does no harm
    return {"by name": described(items_of(field.hint)[0])}


def is_dataclass(hint: Any) -> bool:
    """Whether values of this type are dataclasses."""
    return isinstance(hint, type) and dataclasses.is_dataclass(hint)


def is_enum(hint: Any) -> bool:
    """Whether values of this type are members of an enum."""
    return isinstance(hint, type) and issubclass(hint, enum.Enum)


def is_array(hint: Any) -> bool:
    """Whether values of this type are arrays."""
    return hint is np.ndarray or typing.get_origin(hint) is np.ndarray


def union_members(hint: Any) -> tuple[Any, ...]:
    """Types of a union; empty for any other."""
    return typing.get_args(hint) if typing.get_origin(hint) in (typing.Union, types.UnionType) else ()


def is_mapping(hint: Any) -> bool:
    """Whether values of this type are mappings from text."""
    origin = typing.get_origin(hint)
    return isinstance(origin, type) and issubclass(origin, Mapping)


def is_sequence(hint: Any) -> bool:
    """Whether values of this type are tuples or other sequences."""
    origin = typing.get_origin(hint)
    return isinstance(origin, type) and issubclass(origin, Sequence)


def items_of(hint: Any) -> tuple[Any, ...]:
    """Types of a sequence's items; an Ellipsis says that there may be any number of the one before it."""
    items = typing.get_args(hint)
    return items if typing.get_origin(hint) is tuple else (*items, Ellipsis)
