"""From a dataclass to a tree of plain values and back; see the package for what a tree is.

What is written and read of a class is worked out once, from its annotations. Reading checks everything: a
field too many or too few, or a value of another type, is refused with its place.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any, TypeVar, get_args

import numpy as np

from impactcell.serialization.stored_form import (
    StoredField,
    fields_of,
    is_array,
    is_dataclass,
    is_enum,
    is_mapping,
    is_sequence,
    items_of,
    union_members,
)

T = TypeVar("T")
Tree = Any
Unknown = dict[tuple[str, ...], dict[str, Tree]]
"""What a stored value holds of members of enums that this version does not know: where, and their trees."""

_Writer = Callable[[Any], Tree]
_Reader = Callable[[Tree, "_Place"], Any]


def to_tree(value: object) -> Tree:
    """Give the tree of a dataclass; equal values give equal trees."""
    kind: Any = type(value)
    return _compiled(kind)(value)


def from_tree(kind: type[T], tree: Tree, *, initial: T | None = None, unknown: Unknown | None = None) -> T:
    """Make the dataclass that a tree was made of.

    Parameters
    ----------
    initial : T, optional
        Has the items of members that the tree lacks, where a field is stored by the members of an enum.
    unknown : dict, optional
        Is given what the tree holds of members that are not known; without it they are refused.

    Raises
    ------
    ValueError
        The tree is not one of a `kind`, or of another version of it; with the place and what is wrong there.
    """
    hint: Any = kind
    value: T = _reader(hint)(tree, _Place((), initial, unknown))
    return value


@cache
def _compiled(kind: type) -> _Writer:
    """Compile what writes a dataclass: one expression, as a state is written every cycle."""
    names: dict[str, Any] = {"paired": partial(zip, strict=True)}
    entries = ", ".join(f"{f.key!r}: {_field_source(f, f'v.{f.name}', names)}" for f in fields_of(kind))
    writer: _Writer = eval(f"lambda v: {{{entries}}}", names)  # noqa: S307 - names of our own fields only
    return writer


def _field_source(stored: StoredField, value: str, names: dict[str, Any]) -> str:
    if stored.members is None:
        return _source(stored.hint, value, names)
    keys = stored.members
    item = _source(items_of(stored.hint)[0], "i", names)
    return f"{{k: {item} for k, i in paired({keys!r}, {value})}}"


def _source(hint: Any, value: str, names: dict[str, Any]) -> str:
    """Give the expression of the tree of `value`; `value` itself where it is written as it is.

    `names` is given what the expression calls.
    """
    if is_dataclass(hint):
        names[f"write_{id(hint)}"] = _compiled(hint)
        return f"write_{id(hint)}({value})"
    if is_enum(hint):
        return f"{value}._value_"
    if is_mapping(hint):
        return f"{{str(k): {_source(get_args(hint)[1], 'i', names)} for k, i in {value}.items()}}"
    if is_sequence(hint):
        items = [_source(item, "i", names) for item in items_of(hint) if item is not Ellipsis]
        if set(items) == {"i"}:
            return value
        if len(items) == 1:
            return f"[{items[0]} for i in {value}]"
        places = [_source(item, f"{value}[{n}]", names) for n, item in enumerate(items_of(hint))]
        return f"[{', '.join(places)}]"
    structured = {m: source for m in union_members(hint) if (source := _source(m, value, names)) != value}
    if not structured:
        return value
    if len(union_members(hint)) > 2 or type(None) not in union_members(hint):
        raise TypeError(f"{hint} has no stored form: which of its types a tree is of cannot be told")
    (source,) = structured.values()
    return f"(None if {value} is None else {source})"


@dataclass(frozen=True, slots=True)
class _Place:
    """Where in a tree something is, and what `from_tree` was given for there."""

    path: tuple[str, ...]
    initial: Any
    unknown: Unknown | None

    def at(self, key: str, initial: Any = None) -> "_Place":
        return replace(self, path=(*self.path, key), initial=initial)

    def refused(self, why: str) -> ValueError:
        return ValueError(f"{'.'.join(self.path) or 'it'} {why}")

    def needs(self, what: str, tree: Tree) -> ValueError:
        held = repr(tree)
        return self.refused(f"needs {what}, holds {held if len(held) < 60 else held[:57] + '...'}")


@cache
def _reader(hint: Any) -> _Reader:
    if is_dataclass(hint):
        return _dataclass_reader(hint)
    if is_array(hint):
        return _read_array
    if is_enum(hint):
        return _enum_reader(hint)
    if is_mapping(hint):
        return _mapping_reader(_reader(get_args(hint)[1]))
    if is_sequence(hint):
        return _sequence_reader(items_of(hint))
    if members := union_members(hint):
        return _union_reader(members)
    return _SCALARS[hint]


def _dataclass_reader(kind: type) -> _Reader:
    fields = {f.key: f for f in fields_of(kind)}
    readers: dict[str, _Reader] = {}

    def read(tree: Tree, place: _Place) -> Any:
        if not isinstance(tree, dict):
            raise place.needs("named values", tree)
        if tree.keys() != fields.keys():
            strange, absent = sorted(tree.keys() - fields), sorted(fields - tree.keys())
            which = [f"holds {', '.join(map(repr, strange))}, which this version does not know"] * bool(
                strange
            )
            raise place.refused("; ".join([*which, *[f"lacks {', '.join(absent)}"] * bool(absent)]))
        if not readers:  # a class may hold itself: its fields are looked at when they are needed
            readers.update({key: _field_reader(f) for key, f in fields.items()})
        return kind(
            **{
                f.name: readers[key](tree[key], place.at(key, getattr(place.initial, f.name, None)))
                for key, f in fields.items()
            }
        )

    return read


def _field_reader(stored: StoredField) -> _Reader:
    if stored.members is None:
        return _reader(stored.hint)
    keys = stored.members
    item = _reader(items_of(stored.hint)[0])

    def read(tree: Tree, place: _Place) -> Any:
        if not isinstance(tree, dict):
            raise place.needs("named values", tree)
        strange = {key: tree[key] for key in tree if key not in keys}
        absent = [key for key in keys if key not in tree]
        if strange and place.unknown is None:
            raise place.refused(f"holds {', '.join(strange)}, which this version does not know")
        if absent and place.initial is None:
            raise place.refused(f"lacks {', '.join(absent)}")
        if strange and place.unknown is not None:
            place.unknown[place.path] = strange
        return tuple(
            item(tree[key], place.at(key)) if key in tree else place.initial[n] for n, key in enumerate(keys)
        )

    return read


def _read_array(tree: Tree, place: _Place) -> Any:
    if not isinstance(tree, np.ndarray):
        raise place.needs("an array", tree)
    return tree


def _enum_reader(kind: Any) -> _Reader:
    members = {member.value: member for member in kind}

    def read(tree: Tree, place: _Place) -> Any:
        if not isinstance(tree, int | str) or isinstance(tree, bool) or tree not in members:
            raise place.needs(f"one of {', '.join(map(str, members))}", tree)
        return members[tree]

    return read


def _mapping_reader(item: _Reader) -> _Reader:
    def read(tree: Tree, place: _Place) -> Any:
        if not isinstance(tree, Mapping):
            raise place.needs("named values", tree)
        return {key: item(value, place.at(key)) for key, value in tree.items()}

    return read


def _sequence_reader(items: tuple[Any, ...]) -> _Reader:
    readers = [_reader(item) for item in items if item is not Ellipsis]
    endless = Ellipsis in items

    def read(tree: Tree, place: _Place) -> Any:
        if not isinstance(tree, list | tuple):
            raise place.needs("a list", tree)
        if not endless and len(tree) != len(readers):
            raise place.needs(f"{len(readers)} values", tree)
        which = [readers[0]] * len(tree) if endless else readers
        return tuple(
            reader(value, place.at(str(n))) for n, (reader, value) in enumerate(zip(which, tree, strict=True))
        )

    return read


def _union_reader(members: tuple[Any, ...]) -> _Reader:
    """Read the one type that a tree can be of: None, a list or what is left."""
    lists = [_reader(member) for member in members if is_sequence(member)]
    others = [_reader(m) for m in members if m is not type(None) and not is_sequence(m)]

    def read(tree: Tree, place: _Place) -> Any:
        if tree is None and type(None) in members:
            return None
        fitting = lists if isinstance(tree, list | tuple) and lists else others
        if not fitting:
            raise place.needs("a list", tree)
        return fitting[0](tree, place)

    return read


def _scalar_reader(kind: type, what: str) -> _Reader:
    def read(tree: Tree, place: _Place) -> Any:
        if type(tree) is not kind:
            raise place.needs(what, tree)
        return tree

    return read


def _read_float(tree: Tree, place: _Place) -> float:
    if type(tree) is not float and type(tree) is not int:
        raise place.needs("a number", tree)
    return float(tree)


_SCALARS: dict[Any, _Reader] = {
    float: _read_float,
    int: _scalar_reader(int, "a whole number"),
    bool: _scalar_reader(bool, "true or false"),
    str: _scalar_reader(str, "text"),
}
