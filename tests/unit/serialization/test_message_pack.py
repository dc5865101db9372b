"""A value unpacked from its bytes is the same value, to the last bit; bytes of anything else are refused."""

import dataclasses
import math
import struct
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactcell.records import Alarm, Quality, Samples, Shelving
from impactcell.serialization import json_text
from impactcell.serialization.message_pack import pack, unpack


@dataclass(frozen=True, slots=True, eq=False)
class Inner:
    table: Samples
    counts: tuple[int, ...]
    names: tuple[str | None, ...] = ()
    only: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Outer:
    value: float
    inner: Inner | None
    alarms: tuple[Alarm, ...]
    pair: tuple[int, str]
    span: tuple[float, float]
    maybe: float | None = None
    quality: Quality | None = None
    said: str | None = None
    sure: bool = False


@given(
    st.lists(st.floats(), min_size=4, max_size=4),
    st.lists(st.floats(), max_size=12),
    st.lists(st.integers(-(2**63), 2**64 - 1), max_size=4),
    st.text(),
)
def test_round_trip_is_exact(four, numbers, counts, text):
    alarm = Alarm("WearLimit", shelving=Shelving.TIMED, shelved_until_ns=2**62, message=text)
    inner = Inner(np.array(numbers), tuple(counts), (None, text), four[1])
    outer = Outer(
        four[0], inner, (alarm, alarm), (3, text), (four[2], four[3]), four[1], Quality.BAD, text, True
    )
    data = pack(outer)
    back = unpack(Outer, data)
    assert pack(back) == data
    assert json_text.dumps(back) == json_text.dumps(outer)
    assert back.alarms[0].shelving is Shelving.TIMED
    assert back.inner.table.tobytes() == inner.table.tobytes()
    back.inner.table[:] = 1.0
    assert math.copysign(1, back.value) == math.copysign(1, four[0]) or math.isnan(four[0])


def test_none_and_shapes_survive():
    outer = Outer(-0.0, Inner(np.zeros((0, 22)), ()), (), (1, ""), (0.0, math.inf))
    back = unpack(Outer, pack(outer))
    assert back.inner.table.shape == (0, 22)
    assert (back.maybe, back.quality, back.said) == (None, None, None)
    turned = Inner(np.arange(6.0).reshape(2, 3).T, ())
    assert unpack(Inner, pack(turned)).table.tolist() == [[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]]


def test_it_takes_little_more_room_than_the_numbers():
    assert len(pack(Inner(np.zeros(500), ()))) < 500 * 8 + 60


SAME = [("table", Samples), ("counts", tuple[int, ...]), ("names", tuple[str | None, ...])]


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ([*SAME, ("other", float)], "it holds 'only', which this version does not know; lacks other"),
        (SAME, "it holds 'only', which this version does not know$"),
        ([SAME[0], ("counts", tuple[str, ...]), SAME[2], ("only", float)], "counts.0 needs text, holds 1"),
        ([*SAME, ("only", float), ("more", float, 0.0)], "it lacks more"),
    ],
    ids=["another name", "one less", "another type", "one more with a default"],
)
def test_another_version_is_refused(fields, why):
    older = dataclasses.make_dataclass("Inner", fields, frozen=True, slots=True)
    with pytest.raises(ValueError, match=why):
        unpack(older, pack(Inner(np.zeros(3), (1,))))


def test_damaged_bytes_are_refused():
    data = pack(Inner(np.arange(3.0), (1, 2), ("a",)))
    for end in range(len(data)):
        with pytest.raises(ValueError, match=r".+"):
            unpack(Inner, data[:end])
    with pytest.raises(ValueError, match="trailing"):
        unpack(Inner, data + struct.pack("<d", 1.0))
    with pytest.raises(ValueError, match="only needs a number, holds 'x'"):
        unpack(Inner, pack(Inner(np.zeros(3), (1,), (), "x")))
    with pytest.raises(ValueError, match=r".+"):
        unpack(Inner, data.replace(data[data.index(b"table") + 5 :][:3], b"\xc3\xc3\xc3", 1))


@pytest.mark.parametrize(
    ("value", "why"),
    [
        (Inner(np.zeros(2, np.float32), ()), "float32"),
        (Inner(np.zeros(2), (1j,)), "complex"),
        (Inner(np.zeros(2), (b"" for _ in ())), "generator"),
    ],
)
def test_what_cannot_be_written_is_refused(value, why):
    with pytest.raises(TypeError, match=why):
        pack(value)
