"""What is stored does not depend on the names of classes, nor, where it is declared, on those of fields."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pytest

from impactcell.records import Quality, Samples
from impactcell.serialization import described, dumps, pack, stored, unpack
from impactcell.serialization.tree import Unknown, from_tree, to_tree


@dataclass(frozen=True)
class Item:
    value: float


@dataclass(frozen=True)
class Before:
    mean: float
    items: tuple[Item, ...] = field(metadata=stored(by=("left", "right")))


@dataclass(frozen=True)
class Renamed:
    """Another class with another name of the same field."""

    level: float = field(metadata=stored(key="mean"))
    things: tuple[Item, ...] = field(metadata=stored(key="items", by=("left", "right")))


@dataclass(frozen=True)
class More:
    mean: float
    items: tuple[Item, ...] = field(metadata=stored(by=("top", "left", "right")))


def test_a_declared_key_outlives_the_name_of_its_field_and_class():
    before, renamed = Before(0.1, (Item(1.0), Item(2.0))), Renamed(0.1, (Item(1.0), Item(2.0)))
    assert pack(before) == pack(renamed)
    assert unpack(Renamed, pack(before)) == renamed
    assert described(Before) == described(Renamed)
    assert dumps(renamed) == '{"mean":0.1,"items":{"left":{"value":1.0},"right":{"value":2.0}}}'


def test_items_with_names_are_found_by_name_and_not_by_place():
    before = Before(0.1, (Item(1.0), Item(2.0)))
    fresh = More(0.0, (Item(7.0), Item(8.0), Item(9.0)))
    more = from_tree(More, to_tree(before), initial=fresh)
    assert more == More(0.1, (Item(7.0), Item(1.0), Item(2.0)))
    with pytest.raises(ValueError, match="items lacks top"):
        from_tree(More, to_tree(before))
    unknown = Unknown()
    assert from_tree(Before, to_tree(more), unknown=unknown) == before
    assert unknown == {("items",): {"top": {"value": 7.0}}}
    with pytest.raises(ValueError, match="items holds top, which this version does not know"):
        from_tree(Before, to_tree(more))


def test_a_description_names_no_class():
    @dataclass(frozen=True)
    class Everything:
        numbers: Samples
        span: tuple[float, int]
        names: tuple[str | None, ...]
        quality: Quality
        maybe: Item | None
        either: Mapping[str, float | tuple[float, ...]]

    shown = described(Everything)
    assert shown == {
        "numbers": "array of float",
        "span": ["float", "int"],
        "names": [{"either": ["str", "nothing"]}, "..."],
        "quality": {"one of": [0, 1, 2]},
        "maybe": {"either": [{"value": "float"}, "nothing"]},
        "either": {"any text": {"either": ["float", ["float", "..."]]}},
    }
    value = Everything(np.zeros(2), (1.0, 2), ("a", None), Quality.BAD, None, {"b": 1.0, "c": (2.0, 3.0)})
    assert pack(unpack(Everything, pack(value))) == pack(value)
    assert unpack(Everything, pack(value)).either == value.either


@pytest.mark.parametrize("hint", [Item | Before, Item | Before | None, Item | float | None])
def test_a_field_whose_type_could_not_be_told_from_its_tree_is_refused(hint):
    kind = dataclasses.make_dataclass("Kind", [("value", hint)], frozen=True)
    with pytest.raises(TypeError, match="cannot be told"):
        pack(kind(Item(1.0)))


@pytest.mark.parametrize(
    ("tree", "why"),
    [
        (
            {"mean": "x", "items": {"left": {"value": 1.0}, "right": {"value": 1.0}}},
            "mean needs a number, holds 'x'",
        ),
        ({"mean": True, "items": {"left": {"value": 1.0}, "right": {"value": 1.0}}}, "mean needs a number"),
        ({"mean": 1.0, "items": []}, "items needs named values"),
        ({"mean": 1.0, "items": {"left": {}, "right": {"value": 1.0}}}, "items.left lacks value"),
    ],
)
def test_what_is_wrong_is_said_with_its_place(tree, why):
    with pytest.raises(ValueError, match=why):
        from_tree(Before, tree)
