"""What any earlier version stored is read by every later one; what a later one stored is refused."""

import math
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactcell.serialization import Migration, Versioned, dumps, pack
from impactcell.serialization.json_text import dump_tree
from impactcell.serialization.message_pack import pack_tree, unpack_tree


@dataclass(frozen=True)
class First:
    mean: float
    spread: float


@dataclass(frozen=True)
class Second:
    level: float
    spread: float
    count: int


@dataclass(frozen=True)
class Moments:
    level: float
    variance: float


@dataclass(frozen=True)
class Third:
    moments: Moments
    samples: int


def third(content):
    return {
        "moments": {"level": content["level"], "variance": content["spread"] ** 2},
        "count": content["count"],
    }


TO_SECOND = Migration(renamed={"mean": "level"}, added={"count": 0})
TO_THIRD = Migration(third, renamed={"count": "samples"})
FIRST = Versioned("a mean", First, ())
SECOND = Versioned("a mean", Second, (TO_SECOND,))
THIRD = Versioned("a mean", Third, (TO_SECOND, TO_THIRD))


@given(st.floats(allow_nan=False) | st.just(math.nan), st.floats(-1e9, 1e9))
def test_every_earlier_format_is_read(mean, spread):
    expected = pack(Third(Moments(mean, spread**2), 0))
    for older in (
        pack(First(mean, spread)),
        FIRST.pack(First(mean, spread)),
        SECOND.pack(Second(mean, spread, 0)),
    ):
        assert pack(THIRD.unpack(older)) == expected
        assert THIRD.is_older(older)
    for text in (dumps(First(mean, spread)), SECOND.dumps(Second(mean, spread, 0))):
        assert pack(THIRD.loads(text)) == expected
    newest = THIRD.pack(THIRD.unpack(pack(First(mean, spread))))
    assert pack(THIRD.unpack(newest)) == expected
    assert not THIRD.is_older(newest)


def test_a_later_format_is_refused_with_its_number():
    later = THIRD.pack(Third(Moments(1.0, 2.0), 3))
    with pytest.raises(ValueError, match="a mean is of format 3, this version knows up to 2"):
        SECOND.unpack(later)
    with pytest.raises(ValueError, match="a mean is of format 3, this version knows up to 1"):
        FIRST.loads(THIRD.dumps(Third(Moments(1.0, 2.0), 3)))


@pytest.mark.parametrize(
    ("tree", "why"),
    [
        ([1, 2], "a format number is needed"),
        ({"format": 0, "content": {}}, "a format number is needed, not 0"),
        ({"format": "2", "content": {}}, "a format number is needed, not '2'"),
        ({"format": 3}, "a mean of format 3 cannot be read: it needs named values, holds None"),
        ({"format": 2, "content": {"level": 1.0}}, "a mean of format 2 cannot be read: KeyError: 'spread'"),
        ({"format": 2, "content": None}, "a mean of format 2 cannot be read: TypeError"),
        ({"mean": 1.0, "spread": 1.0, "more": 1}, "a mean of format 1 cannot be read"),
        ({}, "a mean of format 1 cannot be read"),
    ],
)
def test_what_is_no_stored_value_is_refused(tree, why):
    strict = Versioned("a mean", Second, (TO_SECOND,)) if "more" in str(tree) else THIRD
    with pytest.raises(ValueError, match=why):
        strict.unpack(pack_tree(tree))
    with pytest.raises(ValueError, match=why):
        strict.loads(dump_tree(tree))


@pytest.mark.parametrize("data", [b"", b"\xc1", b"\x81", THIRD.pack(Third(Moments(1.0, 2.0), 3))[:-1]])
def test_damaged_bytes_are_refused(data):
    with pytest.raises(ValueError, match="a mean cannot be read: damaged"):
        THIRD.unpack(data)


def test_a_migration_changes_only_what_its_rows_say():
    before = {
        "a": {"x": 1, "list": [{"x": 2}, {"x": 3}]},
        "any": {"k": {"x": 4}, "l": {"x": 5, "z": 6}},
        "b": 7,
    }
    after = Migration(
        renamed={"a": "A", "a.list.x": "y", "any.*.x": "w"},
        added={"a.new": 8, "any.*.more": 9},
        dropped=("b", "any.*.z"),
    )(before)
    assert after == {
        "A": {"x": 1, "list": [{"y": 2}, {"y": 3}], "new": 8},
        "any": {"k": {"w": 4, "more": 9}, "l": {"w": 5, "more": 9}},
    }
    assert before["b"] == 7
    assert before["any"]["l"] == {"x": 5, "z": 6}


def test_what_was_set_aside_is_written_back_to_its_place():
    written = THIRD.pack(Third(Moments(1.0, 2.0), 3), {("moments",): {"skewness": [1.0]}})
    assert unpack_tree(written)["content"]["moments"] == {"level": 1.0, "variance": 2.0, "skewness": [1.0]}
