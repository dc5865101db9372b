"""Frames and replies. Truth: pymodbus's framer for good frames, the specification's layout for all others."""

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymodbus.framer import FramerSocket
from pymodbus.pdu import DecodePDU
from pymodbus.pdu.register_message import ReadHoldingRegistersResponse

from impactcell.errors import ModbusExceptionError, ProtocolError
from impactcell.fieldbus.codec import (
    FunctionCode,
    check_reply,
    read_request,
    write_request,
)
from impactcell.fieldbus.registers import WIRE
from impactcell.fieldbus.transports.mbap import FrameReader
from impactcell.fieldbus.transports.reply_watch import MbapWatch

PDU = st.binary(min_size=1, max_size=253)
FRAMES = st.lists(st.tuples(st.integers(0, 65_535), st.integers(0, 255), PDU), max_size=6)


def frame(transaction: int, unit: int, pdu: bytes) -> bytes:
    """A PDU in a frame, as the specification has it."""
    return struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu


@given(FRAMES, st.data())
def test_frames_come_out_as_they_went_in_however_they_are_cut(
    frames: list[tuple[int, int, bytes]], data: st.DataObject
) -> None:
    stream = b"".join(frame(*each) for each in frames)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    reader, found = FrameReader(), []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        found += list(reader.feed(stream[start:end]))
    assert found == frames


@settings(max_examples=300)
@given(st.lists(st.binary(max_size=300), max_size=5))
def test_arbitrary_bytes_end_in_frames_or_a_protocol_error(pieces: list[bytes]) -> None:
    reader = FrameReader()
    try:
        found = [each for piece in pieces for each in reader.feed(piece)]
    except ProtocolError:
        return
    consumed = b"".join(frame(*each) for each in found)
    assert b"".join(pieces).startswith(consumed)


@settings(max_examples=300)
@given(PDU, st.sampled_from(list(FunctionCode)), st.integers(1, 120))
def test_arbitrary_reply_ends_in_a_value_or_a_named_error(
    pdu: bytes, function: FunctionCode, count: int
) -> None:
    if function in (FunctionCode.READ_HOLDING, FunctionCode.READ_INPUT):
        request = read_request(function, 100, count)
    else:
        request = write_request(
            100, np.arange(1 if function == FunctionCode.WRITE_SINGLE else count + 1).astype(WIRE)
        )
    try:
        data = check_reply(request, pdu)
    except (ProtocolError, ModbusExceptionError):
        return
    assert pdu[0] == request.pdu[0]
    assert len(data) == (2 * count if request.pdu[0] in (3, 4) else 0)


@given(
    st.lists(st.integers(0, 65_535), min_size=1, max_size=125), st.integers(0, 65_535), st.integers(0, 255)
)
def test_a_reply_made_by_pymodbus_is_read(values: list[int], transaction: int, unit: int) -> None:
    response = ReadHoldingRegistersResponse(registers=values, dev_id=unit, transaction_id=transaction)
    wire = FramerSocket(DecodePDU(is_server=False)).buildFrame(response)
    [(found_transaction, found_unit, pdu)] = FrameReader().feed(wire)
    assert (found_transaction, found_unit) == (transaction, unit)
    data = check_reply(read_request(FunctionCode.READ_HOLDING, 0, len(values)), pdu)
    assert struct.unpack(f">{len(values)}H", data) == tuple(values)


@given(st.integers(0, 65_400), st.lists(st.integers(0, 65_535), min_size=1, max_size=123))
def test_pymodbus_reads_our_requests(address: int, values: list[int]) -> None:
    framer = FramerSocket(DecodePDU(is_server=True))
    write = frame(7, 9, write_request(address, np.array(values, dtype=WIRE)).pdu)
    _, pdu = framer.handleFrame(write, 0, 0)
    assert pdu is not None
    assert (pdu.address, list(pdu.registers), pdu.function_code) == (
        address,
        values,
        6 if len(values) == 1 else 16,
    )
    read = frame(7, 9, read_request(FunctionCode.READ_INPUT, address, len(values)).pdu)
    _, pdu = framer.handleFrame(read, 0, 0)
    assert pdu is not None
    assert (pdu.address, pdu.count, pdu.function_code, pdu.dev_id) == (address, len(values), 4, 9)


@pytest.mark.parametrize(
    ("header", "told"),
    [
        (struct.pack(">HHHB", 1, 5, 6, 1), "protocol 5"),
        (struct.pack(">HHHB", 1, 0, 0, 1), "length 0"),
        (struct.pack(">HHHB", 1, 0, 1, 1), "length 1"),
        (struct.pack(">HHHB", 1, 0, 255, 1), "length 255"),
    ],
)
def test_a_header_that_is_not_modbus_is_named(header: bytes, told: str) -> None:
    with pytest.raises(ProtocolError, match=told):
        list(FrameReader().feed(header))


@pytest.mark.parametrize(
    ("received", "name"),
    [
        (b"HTTP/1.1 400 Bad Request\r\n", "HTTP"),
        (b"SSH-2.0-OpenSSH_9.2\r\n", "SSH"),
        (bytes.fromhex("15030100020216"), "TLS"),
        (bytes.fromhex("16030300580200"), "TLS"),
    ],
)
def test_another_protocol_is_named(received: bytes, name: str) -> None:
    """It said `protocol 21584, length 12081` of a web server."""
    told = f"^{name} answers there, not Modbus TCP$"
    with pytest.raises(ProtocolError, match=told):
        list(FrameReader().feed(received))
    with pytest.raises(ProtocolError, match=told):
        MbapWatch(1, 1, read_request(FunctionCode.READ_INPUT, 0, 1), datagram=False).take(received)


@pytest.mark.parametrize(
    ("code", "name"),
    [
        (1, "illegal function"),
        (2, "illegal data address"),
        (3, "illegal data value"),
        (4, "server device failure"),
        (5, "acknowledge"),
        (6, "server device busy"),
        (8, "memory parity error"),
        (10, "gateway path unavailable"),
        (11, "gateway target device failed to respond"),
        (77, "unknown exception"),
    ],
)
def test_exceptions_have_names(code: int, name: str) -> None:
    request = read_request(FunctionCode.READ_HOLDING, 320, 125)
    with pytest.raises(
        ModbusExceptionError, match=f"125 holding registers from 320 refused: {name}"
    ) as caught:
        check_reply(request, bytes([0x83, code]))
    assert caught.value.code == code


@pytest.mark.parametrize(
    ("pdu", "told"),
    [
        (bytes([4, 4, 0, 1, 0, 2]), "function 4 instead of 3"),
        (bytes([3, 2, 0, 1]), "4 bytes instead of 6"),
        (bytes([3, 6, 0, 1, 0, 2, 0, 3]), "8 bytes instead of 6"),
        (bytes([3, 2, 0, 1, 0, 2]), "another request"),
        (bytes([0x84, 2]), "function 132 instead of 3"),
        (bytes([0x83]), "1 bytes instead of 6"),
    ],
)
def test_a_reply_to_something_else_is_refused(pdu: bytes, told: str) -> None:
    with pytest.raises(ProtocolError, match=told):
        check_reply(read_request(FunctionCode.READ_HOLDING, 10, 2), pdu)


def test_an_echo_of_another_write_is_refused() -> None:
    single = write_request(128, np.array([3], dtype=WIRE))
    assert check_reply(single, bytes([6, 0, 128, 0, 3])) == b""
    with pytest.raises(ProtocolError):
        check_reply(single, bytes([6, 0, 128, 0, 4]))
    multiple = write_request(128, np.array([3, 4], dtype=WIRE))
    assert check_reply(multiple, bytes([16, 0, 128, 0, 2])) == b""
    with pytest.raises(ProtocolError):
        check_reply(multiple, bytes([16, 0, 128, 0, 1]))


@pytest.mark.parametrize(("address", "count"), [(0, 0), (0, 126), (65_535, 2), (-1, 1)])
def test_requests_stay_in_the_register_space(address: int, count: int) -> None:
    with pytest.raises(ValueError, match="cannot read"):
        read_request(FunctionCode.READ_HOLDING, address, count)
    with pytest.raises(ValueError, match="cannot write"):
        write_request(address, np.zeros(count, dtype=WIRE))


def test_the_reasons_for_framing_of_our_own_still_hold() -> None:
    """When this fails, pymodbus has mended its framer, and ours may be given up."""
    framer = FramerSocket(DecodePDU(is_server=False))
    good = bytes.fromhex("000100000005010302002a")
    foreign = bytes.fromhex("000100050005010302002a")
    assert framer.handleFrame(foreign + good, 0, 0) == (0, None)  # stuck for ever: nothing is ever consumed
    endless = struct.pack(">HHHB", 1, 0, 60_000, 1) + bytes(300)
    assert framer.handleFrame(endless, 0, 0) == (0, None)  # waits for 60 000 bytes that no PDU can have
    eight = bytes.fromhex("000100000002018302")
    assert framer.decode(eight)[0] == 9
    _, short = framer.handleFrame(good, 1, 1)  # one register, whatever had been asked for
    assert short is not None
    assert short.registers == [42]
    for stream in (foreign, endless, eight):
        with pytest.raises(ProtocolError):
            [
                check_reply(read_request(FunctionCode.READ_HOLDING, 0, 1), each[2])
                for each in FrameReader().feed(stream)
            ]


@pytest.mark.parametrize("count", [1, 2])
def test_one_is_one_in_words(count: int) -> None:
    end = "s" * (count - 1)
    words = np.zeros(count, np.uint16)
    assert (
        read_request(FunctionCode.READ_HOLDING, 100, count).description
        == f"{count} holding register{end} from 100"
    )
    assert write_request(40, words).description == f"a write of {count} register{end} from 40"
    assert write_request(40, words, "coil").description == f"a write of {count} coil{end} from 40"
