"""What a register can command is what it shows again, to its last code."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactcell.errors import RasterError
from impactcell.fieldbus.positioning_registers import commanded_values, is_ahead, next_sequence
from impactcell.fieldbus.register_map.register import Register
from impactcell.fieldbus.register_map.register_types import code_range
from impactcell.fieldbus.registers import RegisterMap
from impactcell.numerics.raster import ANY_VALUE


def a_map(register: Register) -> RegisterMap:
    return RegisterMap("one", {register.name: register})


@given(
    st.sampled_from(["u16", "i16", "u32", "bcd16"]),
    st.sampled_from([0.001, 0.025, 0.1, 1.0, 7.0]),
    st.sampled_from([-30.0, -0.3, 0.0, 0.3, 5.0]),
    st.sampled_from([None, (-5, 90), (1000, 1200)]),
)
def test_the_ends_and_the_steps_of_a_register_are_shown_again(
    kind: str, scale: float, offset: float, saturation: tuple[int, int] | None
) -> None:
    if saturation is not None and kind != "i16":
        saturation = (max(saturation[0], 0), saturation[1])
    register = Register("x", 0, kind, unit="mm", scale=scale, offset=offset, saturation=saturation)
    try:
        values = commanded_values(a_map(register), "x")
    except RasterError:
        most = max(register.saturation or code_range(kind) or (0, 0))
        assert float(register.decode(register.encode(register.offset + scale * most))) <= 1e-9 * scale
        return
    assert 0.0 < values.first <= values.last
    assert values.first > 1e-9 * values.step
    for value in (values.first, min(values.first + values.step, values.last), values.last):
        assert register.decode(register.encode(value)) == pytest.approx(value, rel=1e-12)
    below = float(register.decode(register.encode(values.first - values.step)))  # type: ignore[arg-type]
    assert below <= 1e-9 * values.step or below == pytest.approx(values.first)


def test_floats_command_any_value(fpga: RegisterMap) -> None:
    assert commanded_values(fpga, "command_velocity") is ANY_VALUE
    bare = replace(fpga, registers={})
    assert commanded_values(bare, "command_velocity") is ANY_VALUE
    whole = a_map(Register("x", 0, "u64", unit="nm"))
    assert commanded_values(whole, "x").last == pytest.approx(2**64 * 1e-9)
    assert math.isfinite(commanded_values(whole, "x").last)


@given(st.data(), st.sampled_from([9, 9999, 32_767, 65_535, 2**32 - 1]))
def test_the_next_command_is_ahead_of_the_last_and_another_than_the_one_that_stands_there(
    data: st.DataObject, last: int
) -> None:
    """Both kinds of modules take it: those that look for a number ahead, and those that look for a change."""
    accepted, written = data.draw(st.integers(0, last)), data.draw(st.integers(0, last))
    number = next_sequence(accepted, written, last)
    assert 1 <= number <= last
    assert is_ahead(number, accepted, last)
    assert number not in (accepted, written)


@given(st.data(), st.sampled_from([3, 9999, 2**32 - 1]))
def test_of_two_numbers_one_is_ahead_of_the_other(data: st.DataObject, last: int) -> None:
    one, other = data.draw(st.integers(1, last)), data.draw(st.integers(1, last))
    ahead = [is_ahead(one, other, last), is_ahead(other, one, last)]
    assert sum(ahead) == (one != other)
    assert not is_ahead(0, one, last)
