"""Register maps. Truth: `struct`, pymodbus's conversions, zlib, and the layout as written in the map file."""

import copy
import math
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymodbus.client import ModbusTcpClient

from impactcell.errors import MapError
from impactcell.fieldbus.register_map.register_types import SI_FACTOR
from impactcell.fieldbus.registers import REQUIRED, WIRE, Register, RegisterMap, registers_crc32
from impactcell.process.file_format import WAY_OUT

FORMATS = {"u16": "H", "i16": "h", "u32": "I", "i32": "i", "u64": "Q", "i64": "q", "f32": "f", "f64": "d"}
PYMODBUS = {
    "u16": ModbusTcpClient.DATATYPE.UINT16,
    "i16": ModbusTcpClient.DATATYPE.INT16,
    "u32": ModbusTcpClient.DATATYPE.UINT32,
    "i32": ModbusTcpClient.DATATYPE.INT32,
    "u64": ModbusTcpClient.DATATYPE.UINT64,
    "i64": ModbusTcpClient.DATATYPE.INT64,
    "f32": ModbusTcpClient.DATATYPE.FLOAT32,
    "f64": ModbusTcpClient.DATATYPE.FLOAT64,
}


def words_of(data: bytes) -> np.ndarray:
    return np.frombuffer(data, dtype=WIRE)


def number(kind: str) -> st.SearchStrategy[Any]:
    if kind == "f32":
        return st.floats(width=32, allow_nan=False)
    if kind == "f64":
        return st.floats(allow_nan=False)
    bits = int(kind[1:])
    return (
        st.integers(0, 2**bits - 1)
        if kind[0] == "u"
        else st.integers(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    )


@pytest.mark.parametrize("kind", FORMATS)
@given(data=st.data())
def test_every_type_is_what_struct_says_on_the_wire(kind: str, data: st.DataObject) -> None:
    value = data.draw(number(kind))
    register = Register("x", 0, kind)
    wire = words_of(struct.pack(f">{FORMATS[kind]}", value))
    assert register.encode(value).tobytes() == wire.tobytes()
    assert register.decode(wire) == value


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("order", ["big", "little"])
@given(data=st.data())
@settings(max_examples=25)
def test_word_orders_agree_with_pymodbus(kind: str, order: str, data: st.DataObject) -> None:
    value = data.draw(number(kind))
    theirs = ModbusTcpClient.convert_to_registers(value, PYMODBUS[kind], word_order=order)
    register = Register("x", 0, kind, word_order=order)
    assert register.encode(value).tolist() == theirs
    assert register.decode(np.array(theirs, dtype=WIRE)) == value


@given(
    st.lists(st.integers(-(2**31), 2**31 - 1), min_size=2, max_size=50), st.sampled_from(["big", "little"])
)
def test_arrays_are_their_values_side_by_side(values: list[int], order: str) -> None:
    array = Register("x", 0, "i32", count=len(values), word_order=order)
    single = Register("y", 0, "i32", word_order=order)
    words = array.encode(np.array(values))
    assert words.tolist() == [word for value in values for word in single.encode(value).tolist()]
    assert np.array_equal(array.decode(words), values)


@given(st.text(max_size=8).filter(lambda text: text == text.rstrip() and "\0" not in text))
def test_text_comes_back(text: str) -> None:
    register = Register("x", 0, "string", length=16)
    assert register.decode(register.encode(text)) == text


@given(st.binary(min_size=32, max_size=32))
def test_any_bytes_are_some_text(data: bytes) -> None:
    assert isinstance(Register("x", 0, "string", length=16).decode(words_of(data)), str)


@given(st.floats(-900.0, 900.0))
def test_scaled_value_is_right_to_half_a_code_or_saturated(force_n: float) -> None:
    register = Register(
        "force", 0, "i16", unit="N", scale=0.025, saturation=(-32767, 32767), not_a_number=-32768
    )
    back = register.decode(register.encode(force_n))
    assert isinstance(back, float)
    assert abs(back - min(max(force_n, -819.175), 819.175)) <= 0.0125 * (1 + 1e-9)


def test_codes_that_mean_no_value_become_nan() -> None:
    register = Register("x", 0, "i16", count=3, unit="N", scale=0.5, not_a_number=-32768)
    words = np.array([2, -32768, -4], dtype=np.int16).astype(np.uint16).astype(WIRE)
    np.testing.assert_array_equal(register.decode(words), [1.0, math.nan, -2.0])
    assert register.encode(np.array([1.0, math.nan])).tolist() == [2, 0x8000]


def test_a_code_that_means_no_value_becomes_nan_also_where_there_is_one_value() -> None:
    register = Register("x", 0, "i16", unit="N", scale=0.5, not_a_number=-32768)
    assert math.isnan(float(register.decode(register.encode(math.nan))))
    assert register.decode(np.array([2], dtype=WIRE)) == 1.0
    assert register.decode(np.array([0x8001], dtype=WIRE)) == -16383.5


def test_units_become_si() -> None:
    speed = Register("v", 0, "f32", unit="mm/min")
    assert speed.decode(speed.encode(0.1)) == pytest.approx(0.1, rel=1e-7)
    assert struct.unpack(">f", speed.encode(0.1).tobytes())[0] == pytest.approx(6000.0, rel=1e-7)
    assert SI_FACTOR["um"] == 1e-6


@pytest.mark.parametrize(
    ("register", "value"),
    [
        (Register("x", 0, "u16"), 65_536),
        (Register("x", 0, "i16"), -32_769),
        (Register("x", 0, "i16", unit="N"), math.nan),
        (Register("x", 0, "string", length=1), "abc"),
        (Register("x", 0, "u16", count=2), np.arange(3)),
    ],
)
def test_what_does_not_fit_is_refused(register: Register, value: Any) -> None:
    with pytest.raises(MapError, match="register x"):
        register.encode(value)


def test_wrong_number_of_words_is_refused() -> None:
    with pytest.raises(MapError):
        Register("x", 0, "u32").decode(np.zeros(4, dtype=WIRE))
    with pytest.raises(MapError):
        Register("x", 0, "u32").decode(np.zeros(3, dtype=WIRE))


def test_the_documented_map_is_sound(fpga: RegisterMap, declaration: dict[str, Any]) -> None:
    taken: dict[int, str] = {}
    for name, entry in declaration["registers"].items():
        size = (
            entry.get("length") or entry.get("count", 1) * struct.calcsize(">" + FORMATS[entry["type"]]) // 2
        )
        assert fpga[name].words == size
        assert entry["description"].strip().endswith(".")
        for address in range(entry["address"], entry["address"] + size):
            assert taken.setdefault(address, name) == name
    assert max(taken) < 65_536
    assert fpga.slots >= 8
    assert (fpga["force"].count, fpga["position"].count) == (20_000, 4_000)


def test_status_block_and_header_are_one_request_each(fpga: RegisterMap) -> None:
    assert fpga["command_cycle"].end - fpga["state"].address <= 125
    header = fpga.header()
    assert header[0].name == "window_sequence"
    assert header[-1].end - header[0].address <= 125


def changed(declaration: dict[str, Any], name: str, **entry: Any) -> dict[str, Any]:
    copied = copy.deepcopy(declaration)
    copied["registers"].setdefault(name, {}).update(entry)
    return copied


@pytest.mark.parametrize(
    ("name", "entry", "message"),
    [
        ("velocity", {"address": 267}, "registers cycle_time and velocity overlap at 267"),
        (
            "window_sequence_after",
            {"address": 65_535},
            "window_sequence_after ends at 65536, outside 0..65535",
        ),
        ("velocity", {"address": -1}, "velocity: address must be an address 0..65535"),
        ("velocity", {"address": 70_000}, "velocity: address must be"),
        ("velocity", {"address": True}, "velocity: address must be"),
        ("velocity", {"type": "f16"}, "velocity: type must be u16"),
        ("velocity", {"unit": "furlong"}, "velocity: unit 'furlong' is not known"),
        ("velocity", {"scale": 0}, "velocity: scale must be a number above 0"),
        ("velocity", {"colour": "red"}, "velocity: unknown key colour"),
        ("velocity", {"length": 2}, "velocity: length belongs to type string"),
        ("force", {"saturation": [5, 1]}, "force: saturation must be two codes, the lower first"),
        ("force", {"table": "coils"}, "force: table must be holding, input, coil or discrete"),
        ("force", {"table": "input"}, "the capture window must lie in one table"),
        (
            "window_sequence_after",
            {"address": 200},
            "must lie between window_sequence and window_sequence_after",
        ),
        (
            "capture_ready",
            {"address": 100, "type": "u16"},
            (
                "register capture_ready must lie between window_sequence and window_sequence_after: what is "
                "read before the one or after the other can change unseen; have the module show it there, or "
                "leave both out of the map: a capture without a CRC is then read twice"
            ),
        ),
        ("ring_cycle", {"count": 1}, "ring_cycle must be an array"),
        ("extra", {"address": 40_000}, "extra: type is missing"),
        ("state", {"codes": {0: False}}, "state: codes must be whole numbers with their names"),
    ],
)
def test_a_bad_map_is_refused_with_its_register(
    declaration: dict[str, Any], name: str, entry: dict[str, Any], message: str
) -> None:
    with pytest.raises(MapError, match="register map fpga-v1") as caught:
        RegisterMap.from_mapping(changed(declaration, name, **entry))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("name", "entry", "message"),
    [
        (
            "force",
            {"not_a_number": 0x8000},
            "force: not_a_number 32768 is outside of i16, -32768 to 32767; write -32768",
        ),
        (
            "position",
            {"not_a_number": 0x80000000},
            "not_a_number 2147483648 is outside of i32, -2147483648 to 2147483647; write -2147483648",
        ),
        (
            "actuator",
            {"type": "u32", "not_a_number": -1, "saturation": [0, 9]},
            "to 4294967295; write 4294967295",
        ),
        ("force", {"not_a_number": 70_000}, "not_a_number 70000 is outside of i16, -32768 to 32767"),
        ("force", {"saturation": [0, 65_535]}, "saturation 65535 is outside of i16, -32768 to 32767"),
        (
            "force",
            {"type": "bcd16", "saturation": [0, 9999], "not_a_number": 0xFFFF},
            "65535 is outside of bcd16, 0 to 9999; a code with a digit above 9 is no number anyway",
        ),
        ("map_version", {"expect": 70_000}, "map_version: expect 70000 is outside of u16, 0 to 65535"),
        ("map_version", {"expect": -1}, "expect -1 is outside of u16, 0 to 65535; write 65535"),
        ("map_version", {"expect": "1"}, "expect must be a whole number, not '1'"),
        ("module_name", {"expect": 7}, "expect must be text, in quotes, not 7"),
        ("module_name", {"expect": "IMPACT-FPGA-TWIN1"}, "expect has 17 bytes, 8 registers hold 16"),
        (
            "module_name",
            {"expect": "IMPACT "},
            "expect must end without a space and have no NUL, not 'IMPACT '",
        ),
        ("ring_cycle", {"expect": 1}, "ring_cycle: expect belongs to a single value"),
        (
            "extra",
            {"address": 9, "type": "bit", "table": "coil", "expect": 2},
            "extra: expect 2 is outside of bit, 0 to 1",
        ),
        (
            "extra",
            {"address": 112, "type": "u16", "bit": 3, "expect": 8},
            "expect 8 is outside of bit, 0 to 1",
        ),
        (
            "state",
            {"codes": {0: "idle", 65_536: "moving"}},
            "state: codes: key 65536 is outside of u16, 0 to 65535",
        ),
        (
            "extra",
            {"address": 112, "type": "i16", "codes": {0xFFFF: "gone"}},
            "codes: key 65535 is outside of i16",
        ),
    ],
)
def test_a_code_that_a_register_never_shows_is_refused(
    declaration: dict[str, Any], name: str, entry: dict[str, Any], message: str
) -> None:
    """It matched nothing: a lost sample was one of -819.2 N."""
    with pytest.raises(MapError, match="register map fpga-v1") as caught:
        RegisterMap.from_mapping(changed(declaration, name, **entry))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("name", "entry"),
    [
        ("force", {"saturation": [-32_768, 32_767]}),
        ("map_version", {"expect": 65_535}),
        ("module_name", {"expect": "IMPACT-FPGA-TWIN"}),
        ("state", {"codes": {0: "idle", 65_535: "none"}}),
        ("extra", {"address": 112, "type": "f32", "expect": 70_000}),
        ("extra", {"address": 112, "type": "u16", "unit": "mm", "expect": 70_000}),
        ("extra", {"address": 112, "type": "i16", "unit": "mm", "codes": {70_000: "gone"}}),
        ("extra", {"address": 112, "type": "u16", "bit": 15, "expect": 1}),
    ],
)
def test_a_code_at_the_end_of_its_type_is_one(
    declaration: dict[str, Any], name: str, entry: dict[str, Any]
) -> None:
    assert RegisterMap.from_mapping(changed(declaration, name, **entry))


@pytest.mark.parametrize("name", REQUIRED)
def test_a_missing_register_is_named(declaration: dict[str, Any], name: str) -> None:
    copied = copy.deepcopy(declaration)
    del copied["registers"][name]
    with pytest.raises(MapError, match=f"register {name} is missing"):
        RegisterMap.from_mapping(copied)


@pytest.mark.parametrize("content", [{}, [], None, "text", {"registers": 3}, {"registers": None}])
def test_what_is_no_map_at_all_is_refused(content: Any) -> None:
    with pytest.raises(MapError, match="must be a mapping with format, name and registers"):
        RegisterMap.from_mapping(content)


@pytest.mark.parametrize("content", [{"registers": {"a": 1}}, {"format": 0, "registers": {}}])
def test_another_format_is_refused(content: dict[str, Any]) -> None:
    with pytest.raises(MapError, match="format must be 1"):
        RegisterMap.from_mapping(content)


@pytest.mark.parametrize("content", [{"format": 2, "registers": {"a": 1}}, {"format": 2, "blocks": []}])
def test_of_a_newer_format_nothing_else_is_told(content: dict[str, Any]) -> None:
    with pytest.raises(MapError) as refused:
        RegisterMap.from_mapping(content)
    assert str(refused.value) == f"the register map is of format 2; {WAY_OUT}"


@given(
    st.lists(
        st.tuples(st.integers(0, 65_535), st.sampled_from(list(FORMATS)), st.integers(1, 40)),
        min_size=1,
        max_size=8,
    )
)
def test_overlap_and_overrun_are_found_whenever_they_are_there(entries: list[tuple[int, str, int]]) -> None:
    registers = {
        f"r{i}": {"address": address, "type": kind, "count": count}
        for i, (address, kind, count) in enumerate(entries)
    }
    with pytest.raises(MapError) as caught:  # always: nothing that is required is there
        RegisterMap.from_mapping({"format": 1, "registers": registers})
    spans = [
        range(address, address + count * struct.calcsize(">" + FORMATS[kind]) // 2)
        for address, kind, count in entries
    ]
    overlap = any(set(a) & set(b) for i, a in enumerate(spans) for b in spans[i + 1 :])
    assert ("overlap" in str(caught.value)) == overlap
    assert ("outside 0..65535" in str(caught.value)) == any(span.stop > 65_536 for span in spans)


def test_other_word_order_for_a_cell(fpga: RegisterMap) -> None:
    swapped = fpga.with_word_order("little")
    assert swapped["session"].encode(0x0001_0002).tolist() == [2, 1]
    assert fpga["session"].encode(0x0001_0002).tolist() == [1, 2]


def test_crc_is_that_of_the_bytes_on_the_wire() -> None:
    assert registers_crc32(words_of(b"12345678")) == 0x9AE0_DAAF  # CRC-32/ISO-HDLC of "12345678"
    assert registers_crc32(words_of(b"1234"), words_of(b"5678")) == 0x9AE0_DAAF


def test_unknown_register_is_named(fpga: RegisterMap) -> None:
    assert "velocity" in fpga
    with pytest.raises(MapError, match="no register speed"):
        fpga["speed"]
