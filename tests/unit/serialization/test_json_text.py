"""A value restored from its text is the same value, to the last bit."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactcell.physics import Plant
from impactcell.prediction import Model, Prior
from impactcell.records import Alarm, Samples, Shelving
from impactcell.serialization import json_text


@dataclass(frozen=True, slots=True, eq=False)
class Inner:
    table: Samples
    counts: tuple[int, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Outer:
    value: float
    inner: Inner | None
    alarms: tuple[Alarm, ...]
    pair: tuple[int, str]
    named: dict[str, float]


@given(
    st.floats(),
    st.lists(st.floats(), max_size=12),
    st.lists(st.integers(), max_size=4),
    st.dictionaries(st.text(), st.floats(), max_size=3),
)
def test_round_trip_is_exact(value, numbers, counts, named):
    alarm = Alarm("WearLimit", shelving=Shelving.TIMED, shelved_until_ns=2**62)
    outer = Outer(value, Inner(np.array(numbers), tuple(counts)), (alarm,), (3, "ä"), named)
    data = json_text.dumps(outer)
    back = json_text.loads(Outer, data)
    assert json_text.dumps(back) == data
    assert back.alarms[0].shelving is Shelving.TIMED
    assert back.inner.table.dtype == np.float64
    assert back.inner.table.tobytes() == outer.inner.table.tobytes()
    assert math.copysign(1, back.value) == math.copysign(1, value) or math.isnan(value)


def test_none_and_shapes_survive():
    outer = Outer(-0.0, Inner(np.zeros((0, 22)), ()), (), (1, ""), {})
    back = json_text.loads(Outer, json_text.dumps(outer))
    assert back.inner.table.shape == (0, 22)
    assert json_text.loads(Outer, json_text.dumps(Outer(0.0, None, (), (1, ""), {}))).inner is None


def test_another_version_is_refused():
    with pytest.raises(ValueError, match="it lacks counts"):
        json_text.loads(Inner, '{"table": 1}')
    with pytest.raises(ValueError, match=r"table needs an array, holds 1"):
        json_text.loads(Inner, '{"table": 1, "counts": []}')
    with pytest.raises(ValueError, match="it needs named values"):
        json_text.loads(Inner, "[]")
    with pytest.raises(ValueError, match="Expecting"):
        json_text.loads(Inner, "{")
    with pytest.raises(TypeError, match="complex"):
        json_text.dumps(Inner(np.zeros(1), (1j,)))


def test_a_model_with_one_and_with_many_numbers_comes_back() -> None:
    plant = Plant(
        6.5e5,
        465.0,
        0.2,
        0.152,
        effects={"surface_tilt": {"tilt_rad": 0.1}, "batch_shift": {"relative_change": (0.1, -0.2)}},
    )
    model = Model("m", plant, Prior(1.0, 2.0, 3.0), intervals={"surface_tilt": {"tilt_rad": (0.0, 0.2)}})
    assert json_text.loads(Model, json_text.dumps(model)) == model
