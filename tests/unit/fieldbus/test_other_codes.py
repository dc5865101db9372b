"""Registers as other makers show them. Truth: `struct` in little-endian order, decimal text, binary text."""

import math
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.errors import MapError, NotDecimalError
from impactcell.fieldbus.register_map.map_validation import validate_map
from impactcell.fieldbus.register_map.register_types import KINDS
from impactcell.fieldbus.registers import WIRE, Register

INTEGERS = {"u16": "H", "i16": "h", "u32": "I", "i32": "i", "u64": "Q", "i64": "q"}


def wire(data: bytes) -> np.ndarray:
    return np.frombuffer(data, dtype=WIRE)


def bounds(kind: str) -> tuple[int, int]:
    info = np.iinfo(KINDS[kind])
    return int(info.min), int(info.max)


@pytest.mark.parametrize("kind", INTEGERS)
@given(data=st.data())
@settings(max_examples=30)
def test_little_words_of_little_bytes_are_little_endian(kind: str, data: st.DataObject) -> None:
    values = data.draw(st.lists(st.integers(*bounds(kind)), min_size=1, max_size=5))
    if kind == "u64":
        values = [value >> 1 for value in values]  # arrays of codes are signed
    shown = wire(struct.pack(f"<{len(values)}{INTEGERS[kind]}", *values))
    register = Register("x", 0, kind, count=len(values), word_order="little", byte_order="little")
    assert np.atleast_1d(np.asarray(register.decode(shown))).tolist() == values
    assert register.encode(np.array(values)).tobytes() == shown.tobytes()


@given(st.integers(-(2**31), 2**31 - 1))
def test_little_bytes_alone_swap_within_each_register(value: int) -> None:
    big = struct.pack(">i", value)
    shown = wire(bytes((big[1], big[0], big[3], big[2])))
    register = Register("x", 0, "i32", byte_order="little")
    assert register.decode(shown) == value
    assert register.encode(value).tobytes() == shown.tobytes()


@given(st.text(alphabet="ABCdef-019", max_size=8))
def test_text_of_little_bytes_comes_back(text: str) -> None:
    register = Register("x", 0, "string", length=4, byte_order="little", word_order="little")
    shown = register.encode(text)
    assert shown.byteswap().tobytes().rstrip(b"\0") == text.encode()
    assert register.decode(shown) == text


@pytest.mark.parametrize(("kind", "digits"), [("bcd16", 4), ("bcd32", 8)])
@given(data=st.data())
def test_decimals_are_written_as_one_reads_them(kind: str, digits: int, data: st.DataObject) -> None:
    numbers = data.draw(st.lists(st.integers(0, 10**digits - 1), min_size=1, max_size=4))
    shown = wire(bytes.fromhex("".join(f"{number:0{digits}d}" for number in numbers)))
    register = Register("x", 0, kind, count=len(numbers))
    assert np.atleast_1d(np.asarray(register.decode(shown))).tolist() == numbers
    assert register.encode(np.array(numbers)).tobytes() == shown.tobytes()


@given(st.integers(0, 0xFFFF).filter(lambda code: not f"{code:x}".isdecimal()))
def test_what_is_no_decimal_is_never_a_number(code: int) -> None:
    shown = np.array([code], dtype=WIRE)
    with pytest.raises(NotDecimalError, match=rf"register x \(0\) shows {code:#x}, which is no bcd16"):
        Register("x", 0, "bcd16").decode(shown)
    codes = Register("x", 0, "bcd16", count=2).decode(np.array([code, 0x10], dtype=WIRE))
    np.testing.assert_array_equal(codes, [math.nan, 10.0])
    assert math.isnan(float(Register("x", 0, "bcd16", unit="N").decode(shown)))  # type: ignore[arg-type]
    values = Register("x", 0, "bcd16", count=2, unit="N").decode(np.array([code, 0x10], dtype=WIRE))
    np.testing.assert_array_equal(values, [math.nan, 10.0])


@given(st.integers(-(2**15), 2**15 - 1), st.floats(-1e3, 1e3), st.floats(1e-3, 1e3))
def test_an_offset_is_the_value_of_code_0(code: int, offset: float, scale: float) -> None:
    register = Register("x", 0, "i16", unit="mm", scale=scale, offset=offset)
    shown = np.array([code], dtype=np.int16).astype(np.uint16).astype(WIRE)
    value = register.decode(shown)
    assert isinstance(value, float)
    assert value == pytest.approx((code * scale + offset) * 1e-3, rel=1e-9, abs=1e-12)
    many = Register("x", 0, "i16", count=3, unit="mm", scale=scale, offset=offset)
    np.testing.assert_allclose(many.decode(np.repeat(shown, 3)), value)
    if abs(offset) < 1e4 * scale:
        assert register.encode(value).tobytes() == shown.tobytes()


def test_full_scale_has_the_offset_too() -> None:
    register = Register("x", 0, "u16", unit="N", scale=0.5, offset=-10.0, saturation=(0, 100))
    assert register.full_scale == (-10.0, 40.0)


@given(st.integers(0, 0xFFFF), st.integers(0, 15))
def test_a_bit_is_a_digit_of_the_binary_number(code: int, bit: int) -> None:
    shown = np.array([code], dtype=WIRE)
    assert Register("x", 0, "u16", bit=bit).decode(shown) == int(f"{code:016b}"[15 - bit])
    with pytest.raises(MapError, match="one bit"):
        Register("x", 0, "u16", bit=bit).encode(1)


@given(st.floats(allow_nan=False))
def test_what_is_beyond_64_bits_goes_to_the_nearest_end(value: float) -> None:
    register = Register("x", 0, "i64", unit="N", scale=1.0)
    back = register.decode(register.encode(value))
    assert isinstance(back, float)
    assert back == pytest.approx(min(max(value, -(2.0**63)), 2.0**63), abs=0.5, rel=1e-15)


ENTRY = st.dictionaries(
    st.sampled_from(
        ["address", "type", "count", "length", "table", "writable", "word_order", "byte_order", "bit",
         "scale", "offset", "unit", "not_a_number", "saturation", "expect", "codes", "description", "no"]
    ),
    st.one_of(
        st.integers(-5, 70_000), st.floats(), st.text(max_size=4), st.booleans(), st.none(),
        st.sampled_from(["u16", "i64", "bcd16", "string", "little", "N"]),
        st.lists(st.integers(), max_size=3),
    ),
)  # fmt: skip


@pytest.mark.slow
@given(st.dictionaries(st.text(max_size=5), st.one_of(ENTRY, st.integers(), st.none()), max_size=4))
@settings(max_examples=400)
def test_any_map_is_registers_or_faults(registers: dict[str, Any]) -> None:
    validated = validate_map({"format": 1, "registers": registers})
    for name in registers:
        told = any(fault.startswith(f"register {name}: ") for fault in validated.faults)
        assert name in validated.registers or name in validated.constants or told
    for values in validated.registers.values():
        register = Register(**values)
        if register.words <= 200 and register.bit is None:
            try:
                register.decode(np.zeros(register.words, dtype=WIRE))
            except OverflowError as error:  # a scale that no float can be
                raise AssertionError(values) from error
