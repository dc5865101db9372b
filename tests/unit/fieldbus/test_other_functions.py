"""Functions 1, 2, 5, 15, 22, 23 and 43/14 over every transport. Truth: what the simulated device holds."""

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.errors import FieldbusError, LinkError, ModbusExceptionError, ProtocolError
from impactcell.fieldbus.codec import (
    FunctionCode,
    check_reply,
    mask_write_request,
    read_request,
    read_write_request,
    write_request,
)
from impactcell.fieldbus.device_identification import identification_objects, identification_request
from impactcell.fieldbus.register_client import RegisterClient
from impactcell.fieldbus.registers import WIRE, RegisterMap
from impactcell.fieldbus.request_batching import PartialBlock
from simulator.answers import answer
from simulator.faults import Fault, FaultInjector, FaultKind
from tests.transports import KINDS, Image, bits_of, connected

every = pytest.mark.parametrize("kind", KINDS)
BITS = [FunctionCode.READ_COILS, FunctionCode.READ_DISCRETE]


@every
@pytest.mark.parametrize(("count", "max_registers"), [(1, 125), (9, 125), (2_001, 125), (5_000, 7), (40, 1)])
async def test_bits_arrive_as_they_are(kind: str, count: int, max_registers: int, tmp_path: Path) -> None:
    async with connected(kind, Image(), tmp_path, max_registers=max_registers) as (server, client):
        for seed, table in enumerate(("coil", "discrete")):
            assert np.array_equal(await client.read(17, count, table), bits_of(seed)[17 : 17 + count])
        assert server.requests == 2 * -(-count // (16 * max_registers))


@every
async def test_coils_are_written_one_or_many(kind: str, tmp_path: Path) -> None:
    device = Image()
    wanted = bits_of(7)[:1968]
    async with connected(kind, device, tmp_path) as (_, client):
        before = device.bits["coil"].copy()
        await client.write(5, np.array([1 - before[5]], dtype=WIRE), "coil")
        await client.write(100, wanted, "coil")
        before[5], before[100 : 100 + wanted.size] = 1 - before[5], wanted
        assert np.array_equal(await client.read(0, 3_000, "coil"), before[:3_000])
        assert np.array_equal(device.bits["coil"], before)


@every
async def test_bits_of_a_register_are_changed_alone(kind: str, tmp_path: Path) -> None:
    device = Image()
    async with connected(kind, device, tmp_path) as (_, client):
        await client.write_bits(0x1234, keep=0xFFFF ^ 0x0800, put=0x0800)
        assert (await client.read(0x1233, 3)).tolist() == [0x1233, 0x1A34, 0x1235]
        await client.write_bits(0x1234, keep=0xFFFF ^ 0x0030, put=0)
        assert (await client.read(0x1234, 1)).tolist() == [0x1A04]


@every
@pytest.mark.parametrize("count", [1, 125, 300])
async def test_a_write_and_a_read_go_out_together(kind: str, count: int, tmp_path: Path) -> None:
    device = Image()
    async with connected(kind, device, tmp_path) as (server, client):
        block, other = client.block(100, count), client.block(7, 2, "input")
        words = np.array([9, 8], dtype=WIRE)
        await client.complete(block, other, write=(101 if count > 1 else 50_000, words), at_once=True)
        expected = np.arange(100, 100 + count)
        if count > 1:
            expected[1:3] = words
        assert np.array_equal(block.words(), expected)
        assert other.words().tolist() == [7, 8]
        assert server.requests == -(-count // 125) + 1


@every
async def test_a_device_says_who_made_it(kind: str, tmp_path: Path) -> None:
    """Its texts take two replies."""
    async with connected(kind, Image(), tmp_path) as (server, client):
        assert await client.identification() == {
            "vendor": "Works", "product code": "M-17", "revision": "3.4", "product": "Measuring module",
            "model": "ü" * 60, "application": "x" * 90,
        }  # fmt: skip
        assert server.requests == 2
        assert (await client.read(3, 1)).tolist() == [3]


@every
async def test_a_device_without_them_refuses_and_the_link_stays(kind: str, tmp_path: Path) -> None:
    class Bare:
        def read(self, table: str, address: int, count: int) -> np.ndarray:
            if table in ("coil", "discrete"):
                raise NotImplementedError(table)
            return np.arange(address, address + count).astype(WIRE)

        def write(self, address: int, words: np.ndarray) -> None:
            raise LookupError(address)

    async with connected(kind, Bare(), tmp_path) as (_, client):
        for asking in (
            client.read(0, 1, "coil"), client.read(0, 1, "discrete"), client.identification(),
            client.write(0, np.ones(1, WIRE), "coil"), client.write(0, np.ones(2, WIRE), "coil"),
        ):  # fmt: skip
            with pytest.raises(ModbusExceptionError, match="illegal function") as caught:
                await asking
            assert caught.value.code == 1
        with pytest.raises(
            ModbusExceptionError, match="change of bits of register 4 refused: illegal data addr"
        ):
            await client.write_bits(4, 0xFFFE, 1)
        assert client.connected
        assert (await client.read(3, 2)).tolist() == [3, 4]


@every
@pytest.mark.parametrize("fault", [FaultKind.DROP, FaultKind.WRONG_FUNCTION, FaultKind.WRONG_UNIT])
async def test_a_faulty_identification_closes_the_link_as_any_other_reply(
    kind: str, fault: FaultKind, tmp_path: Path
) -> None:
    async with connected(kind, Image(), tmp_path, timeout_s=4.0) as (server, client):
        server.faults.inject(Fault(fault, remaining=1))
        with pytest.raises((LinkError, ProtocolError)):
            await client.identification()
        assert not client.connected
        await client.connect()
        assert (await client.identification())["vendor"] == "Works"


@pytest.mark.slow
@every
async def test_no_fault_gets_a_wrong_bit_or_name_through(kind: str, tmp_path: Path) -> None:
    faults, draw = FaultInjector(5), np.random.default_rng(5)
    truth, right = {"coil": bits_of(0), "discrete": bits_of(1)}, 0
    async with connected(kind, Image(), tmp_path, faults, timeout_s=1.0, window=4) as (server, client):
        for fault in FaultKind:
            faults.inject(Fault(fault, probability=0.02, seconds=1.25))
        for i in range(45):
            address, count = int(draw.integers(0, 60_000)), int(draw.integers(1, 4_500))
            table = ("coil", "discrete", "")[i % 3]
            try:
                await client.connect()
                if table:
                    assert np.array_equal(
                        await client.read(address, count, table), truth[table][address : address + count]
                    )
                else:
                    assert (await client.identification())["application"] == "x" * 90
            except FieldbusError:
                for link in server.links:
                    link._mute = False
                continue
            right += 1
    assert right > 10
    assert sum(faults.happened.values()) > 3


async def test_commands_and_flags_may_be_bits(tmp_path: Path) -> None:
    layout = RegisterMap.from_mapping(
        {
            "format": 1, "name": "bits", "functions": [22],
            "registers": {
                "cycle_counter": {"address": 0, "type": "u16"},
                "velocity": {"value": 0.1}, "peak_force": {"address": 1, "type": "u16"},
                "state": {"address": 9, "type": "bit", "table": "discrete", "codes": {0: "off", 1: "on"}},
                "command_abort": {"address": 3, "type": "bit", "table": "coil", "writable": True},
                "command_sequence": {"address": 4, "type": "u16", "writable": True},
                "lamp": {"address": 5, "type": "u16", "bit": 11, "writable": True},
            },
        }
    )  # fmt: skip
    device = Image()
    async with connected("tcp", device, tmp_path) as (_, modbus):
        client = RegisterClient(modbus, layout)
        await client.write_values({"command_abort": 1, "command_sequence": 7, "lamp": 1})
        assert device.bits["coil"][3] == 1
        assert (device.words[4], device.words[5]) == (7, 5 | 1 << 11)
        await client.write_values({"command_abort": 0, "lamp": 0})
        assert (device.bits["coil"][3], device.words[5]) == (0, 5)
        values = (await client.read_image(("state", "command_abort", "lamp"))).values
        assert values == {"state": int(bits_of(1)[9]), "command_abort": 0, "lamp": 0}


@given(st.integers(1, 2_000), st.integers(0, 60_000), st.sampled_from(BITS), st.data())
@settings(max_examples=150)
def test_bits_of_any_reply_are_its_bits(
    count: int, address: int, function: FunctionCode, data: st.DataObject
) -> None:
    """Whatever stands in the last byte behind them; a reply of any other length is refused."""
    request = read_request(function, address, count)
    size = -(-count // 8)
    shown = data.draw(st.binary(min_size=size, max_size=size))
    block = PartialBlock(address, count, "coil", 2_000)
    block.fill(0, 1, check_reply(request, bytes([function, size]) + shown))
    text = "".join(f"{byte:08b}"[::-1] for byte in shown)
    assert block.words().tolist() == [int(digit) for digit in text[:count]]
    for wrong in (shown[:-1], shown + b"\0"):
        with pytest.raises(ProtocolError):
            check_reply(request, bytes([function, len(wrong)]) + wrong)
        with pytest.raises(ProtocolError):
            check_reply(request, bytes([function, size]) + wrong)


@given(st.binary(max_size=260))
@settings(max_examples=400)
def test_any_bytes_are_an_identification_or_a_named_error(tail: bytes) -> None:
    request = identification_request()
    pdu = (request.reply_prefix + tail)[:253]
    try:
        data = check_reply(request, pdu)
    except ProtocolError:
        return
    objects, following = identification_objects(data)
    assert len(objects) <= data[3]
    assert following is None or following == data[2]


@given(
    st.dictionaries(st.integers(0, 20), st.binary(max_size=30), max_size=6),
    st.booleans(),
    st.integers(0, 255),
)
def test_an_identification_is_read_and_measured(
    objects: dict[int, bytes],
    more: bool,
    following: int,
) -> None:
    request = identification_request()
    listed = b"".join(bytes((number, len(text))) + text for number, text in objects.items())
    pdu = request.reply_prefix + bytes((0x82, 0xFF * more, following, len(objects))) + listed
    assert request.length_of(pdu) == len(pdu)
    for cut in range(1, len(pdu)):
        assert request.length_of(pdu[:cut]) in (None, len(pdu))
    texts, then = identification_objects(check_reply(request, pdu))
    assert list(texts) == list(objects)
    assert then == (following if more else None)
    with pytest.raises(ProtocolError):
        check_reply(request, pdu + b"\0")


def test_an_identification_that_cannot_be_is_refused() -> None:
    request = identification_request()
    for pdu in (
        b"\x2b\x0d\x02",
        b"\x2b\x0e\x03",
        request.reply_prefix + bytes((0x82, 0, 0, 255)) + b"\0\xff" * 130,
    ):
        with pytest.raises(ProtocolError):
            check_reply(request, pdu)
    with pytest.raises(ModbusExceptionError, match="illegal function"):
        check_reply(request, b"\xab\x01")


@pytest.mark.parametrize(
    "make",
    [
        lambda: read_request(FunctionCode.READ_COILS, 0, 2_001),
        lambda: read_request(FunctionCode.READ_DISCRETE, 65_535, 2),
        lambda: read_request(FunctionCode.READ_COILS, 0, 0),
        lambda: write_request(0, np.zeros(1_969, WIRE), "coil"),
        lambda: write_request(65_535, np.zeros(2, WIRE), "coil"),
        lambda: read_write_request(0, 126, 0, np.zeros(1, WIRE)),
        lambda: read_write_request(0, 1, 0, np.zeros(122, WIRE)),
        lambda: read_write_request(65_535, 2, 0, np.zeros(1, WIRE)),
        lambda: read_write_request(0, 1, 65_535, np.zeros(2, WIRE)),
    ],
)
def test_what_no_request_can_ask_for_is_refused(make: object) -> None:
    assert callable(make)
    with pytest.raises(ValueError, match="a request cannot"):
        make()


def test_an_echo_of_another_change_is_refused() -> None:
    mask = mask_write_request(4, 0xFFFE, 1)
    assert check_reply(mask, mask.pdu) == b""
    with pytest.raises(ProtocolError):
        check_reply(mask, mask.pdu[:-1] + b"\2")
    coil = write_request(4, np.ones(1, WIRE), "coil")
    assert coil.pdu == bytes.fromhex("050004ff00")
    with pytest.raises(ProtocolError):
        check_reply(coil, bytes.fromhex("0500040000"))


@pytest.mark.slow
@given(st.sampled_from([1, 2, 3, 4, 5, 6, 15, 16, 22, 23, 43]), st.binary(max_size=40))
@settings(max_examples=400)
def test_the_simulator_answers_any_request_or_refuses_it(function: int, tail: bytes) -> None:
    device, pdu = Image(), bytes([function]) + tail
    try:
        reply = answer(device, function, pdu)
    except (LookupError, ValueError, NotImplementedError, struct.error):
        return
    assert reply[0] == function
    assert len(reply) <= 253
