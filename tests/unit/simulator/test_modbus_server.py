"""The simulator's Modbus server and control port, by raw sockets and by what the specification says."""

import asyncio
import json
import math
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import numpy as np
import pytest

from impactcell.fieldbus.registers import WIRE, Words
from simulator.control import Control
from simulator.faults import Fault, FaultInjector, FaultKind, corrupt
from simulator.modbus_server import ModbusServer
from simulator.udp_server import UdpServer
from tests.module_client import Client, scenario
from tests.patience import PATIENCE_S


class Image:
    def __init__(self) -> None:
        self.words = np.arange(65_536).astype(WIRE)

    def read(self, table: str, address: int, count: int) -> Words:
        if table in ("coil", "discrete"):
            raise NotImplementedError(table)
        if address + count > 60_000:
            raise LookupError(address)
        return self.words[address : address + count]

    def write(self, address: int, words: Words) -> None:
        if address == 50:
            raise ValueError(address)
        if address == 60:
            raise BlockingIOError
        self.words[address : address + words.size] = words


class Socket:
    """One raw connection."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer

    def send(self, pdu: bytes, transaction: int = 1, unit: int = 1) -> None:
        self.writer.write(struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu)

    async def receive(self) -> tuple[int, int, bytes]:
        header = await self.reader.readexactly(7)
        transaction, _, length, unit = struct.unpack(">HHHB", header)
        return transaction, unit, await self.reader.readexactly(length - 1)

    async def ask(self, pdu: bytes, unit: int = 1) -> bytes:
        self.send(pdu, unit=unit)
        return (await self.receive())[2]


@asynccontextmanager
async def connected(server: ModbusServer) -> AsyncIterator[Socket]:
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    try:
        yield Socket(reader, writer)
    finally:
        writer.close()


@pytest.mark.parametrize(
    ("pdu", "reply"),
    [
        ("03 0064 0002", "03 04 0064 0065"),
        ("04 0064 0002", "04 04 0064 0065"),
        ("06 0064 1234", "06 0064 1234"),
        ("10 0064 0002 04 1234 5678", "10 0064 0002"),
        ("03 0064 0000", "83 03"),
        ("03 0064 007e", "83 03"),
        ("03 ffff 0002", "83 02"),
        ("03 ea5f 0002", "83 02"),
        ("03 0064", "83 03"),
        ("10 0064 0002 03 1234 56", "90 03"),
        ("10 0064 0000 00", "90 03"),
        ("10 ffff 0002 04 1234 5678", "90 02"),
        ("06 0032 0001", "86 03"),
        ("06 003c 0001", "86 06"),
        ("06 0064", "86 03"),
        ("01 0000 0001", "81 01"),
        ("05 0000 ff00", "85 01"),
        ("0f 0000 0001 01 01", "8f 01"),
        ("16 0004 00f2 0025", "16 0004 00f2 0025"),
        ("17 0064 0002 0070 0001 02 1234", "17 04 0064 0065"),
        ("17 0064 0000 0070 0001 02 1234", "97 03"),
        ("17 0064 0002 0070 0002 02 1234", "97 03"),
        ("17 ffff 0002 0070 0001 02 1234", "97 02"),
        ("14 06 06 0004 0001 0000 0002", "94 01"),
        ("2b 0e 01 00", "ab 01"),
    ],
)
async def test_functions_and_exceptions_are_those_of_the_specification(pdu: str, reply: str) -> None:
    async with ModbusServer(Image()) as server, connected(server) as link:
        assert (await link.ask(bytes.fromhex(pdu))).hex() == reply.replace(" ", "")


async def test_another_device_id_is_answered_as_by_a_gateway() -> None:
    async with ModbusServer(Image(), device_id=5) as server, connected(server) as link:
        assert await link.ask(bytes.fromhex("0300640001"), unit=1) == b"\x83\x0b"
        assert await link.ask(bytes.fromhex("0300640001"), unit=5) == b"\x03\x02\x00\x64"


async def test_pipelined_requests_are_all_answered_in_order() -> None:
    async with ModbusServer(Image()) as server, connected(server) as link:
        for i in range(300):
            link.send(struct.pack(">BHH", 3, i, 100), transaction=i)
        for i in range(300):
            transaction, _, pdu = await link.receive()
            assert transaction == i
            assert np.frombuffer(pdu, WIRE, offset=2).tolist() == list(range(i, i + 100))


async def test_a_request_in_pieces_is_put_together() -> None:
    async with ModbusServer(Image()) as server, connected(server) as link:
        for byte in struct.pack(">HHHBBHH", 9, 0, 6, 1, 3, 7, 1):
            link.writer.write(bytes([byte]))
            await link.writer.drain()
            await asyncio.sleep(0)
        assert await link.receive() == (9, 1, b"\x03\x02\x00\x07")


async def test_what_is_not_modbus_is_cut_off_and_others_go_on() -> None:
    async with ModbusServer(Image()) as server, connected(server) as good, connected(server) as bad:
        bad.writer.write(b"GET / HTTP/1.1\r\n\r\n")
        with pytest.raises((asyncio.IncompleteReadError, ConnectionError)):
            await bad.receive()
        assert await good.ask(bytes.fromhex("0300070001")) == b"\x03\x02\x00\x07"


@pytest.mark.parametrize("stray", ["00", "000900000006", "0009000000060103", "0009000100060103"])
async def test_a_datagram_that_is_no_request_is_no_part_of_the_next(stray: str) -> None:
    replies: asyncio.Queue[bytes] = asyncio.Queue()

    class Receiver(asyncio.DatagramProtocol):
        def datagram_received(self, data: bytes, _: Any) -> None:
            replies.put_nowait(data)

    async with UdpServer(Image()) as server:
        loop = asyncio.get_running_loop()
        client, _ = await loop.create_datagram_endpoint(Receiver, remote_addr=("127.0.0.1", server.port))
        for transaction in (1, 2):
            client.sendto(bytes.fromhex(stray))
            client.sendto(struct.pack(">HHHBBHH", transaction, 0, 6, 1, 3, 7, 1))
            async with asyncio.timeout(PATIENCE_S):
                reply = await replies.get()
            assert reply == struct.pack(">HHHBBBH", transaction, 0, 5, 1, 3, 2, 7)
        client.close()


async def test_several_clients_are_served() -> None:
    async with ModbusServer(Image()) as server, connected(server) as a, connected(server) as b:
        a.send(bytes.fromhex("0300010001"), 1)
        b.send(bytes.fromhex("0300020001"), 2)
        assert (await b.receive())[2] == b"\x03\x02\x00\x02"
        assert (await a.receive())[2] == b"\x03\x02\x00\x01"


GOOD = struct.pack(">HHHBBB", 7, 0, 7, 1, 3, 4) + b"\0\x01\0\x02"


@pytest.mark.parametrize(
    ("kind", "differs"),
    [
        (FaultKind.WRONG_TRANSACTION, slice(0, 2)),
        (FaultKind.WRONG_PROTOCOL, slice(2, 4)),
        (FaultKind.WRONG_UNIT, slice(6, 7)),
        (FaultKind.WRONG_FUNCTION, slice(7, 8)),
    ],
)
def test_a_frame_fault_changes_its_field_and_no_other(kind: FaultKind, differs: slice) -> None:
    draw = FaultInjector(1).random
    for _ in range(50):
        bad = corrupt(Fault(kind), GOOD, draw)
        assert bad[differs] != GOOD[differs]
        assert bad[: differs.start] == GOOD[: differs.start]
        assert bad[differs.stop :] == GOOD[differs.stop :]


def test_wrong_lengths_are_always_wrong() -> None:
    draw = FaultInjector(2).random
    seen = {corrupt(Fault(FaultKind.WRONG_LENGTH), GOOD, draw) for _ in range(200)}
    assert GOOD not in seen
    assert len(seen) >= 6


def test_exception_and_busy_are_exceptions() -> None:
    draw = FaultInjector(3).random
    assert corrupt(Fault(FaultKind.EXCEPTION, code=4), GOOD, draw).hex() == "000700000003018304"
    assert corrupt(Fault(FaultKind.BUSY), GOOD, draw).hex() == "000700000003018306"


def test_faults_happen_as_often_as_told_and_then_no_more() -> None:
    faults = FaultInjector(4)
    faults.inject(Fault(FaultKind.DROP, probability=0.25))
    drawn = sum(faults.choose() is not None for _ in range(4000))
    assert 900 < drawn < 1100
    faults.clear(FaultKind.DROP)
    faults.inject(Fault(FaultKind.BUSY, remaining=3))
    assert [faults.choose() is not None for _ in range(5)] == [True, True, True, False, False]
    assert not faults.active
    assert faults.happened == {FaultKind.DROP: drawn, FaultKind.BUSY: 3}


@pytest.mark.parametrize(
    "arguments",
    [
        {"probability": 1.5},
        {"seconds": -1.0},
        {"seconds": math.nan},
        {"seconds": math.inf},
        {"code": 0},
        {"remaining": 0},
    ],
)
def test_impossible_faults_are_refused(arguments: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="fault delay"):
        Fault(FaultKind.DELAY, **arguments)


async def test_the_control_port_arms_disarms_and_acts() -> None:
    faults, called = FaultInjector(), []
    async with Control(
        faults,
        {
            "restart": lambda: called.append("restart"),
            "count": lambda value: value + 1,
            "set_counter": Client(scenario()).device.set_counter,
        },
    ) as control:
        reader, writer = await asyncio.open_connection("127.0.0.1", control.port)

        async def say(command: Any) -> Any:
            writer.write((command if isinstance(command, str) else json.dumps(command)).encode() + b"\n")
            return json.loads(await reader.readline())

        assert await say({"fault": "delay", "probability": 0.5, "seconds": 0.1}) == {"ok": True}
        assert faults.active
        assert await say({"clear": "delay"}) == {"ok": True}
        assert not faults.active
        assert await say({"do": "restart"}) == {"ok": True, "result": None}
        assert called == ["restart"]
        assert await say({"do": "count", "value": 4}) == {"ok": True, "result": 5}
        faults.inject(Fault(FaultKind.DROP))
        faults.choose()
        assert await say({"status": True}) == {"ok": True, "happened": {"drop": 1}}
        assert await say({"clear": None}) == {"ok": True}
        for wrong in (
            "nonsense",
            "[]",
            "3",
            {"fault": "gremlins"},
            {"fault": "delay", "speed": 1},
            {"fault": "exception", "code": 4.5},
            {"fault": "delay", "remaining": "two"},
            {"do": "fly"},
            {"do": "set_counter", "value": -1},
            "[" * 20_000,
            {},
        ):
            answer = await say(wrong)
            assert answer["ok"] is False
            assert answer["error"]
        writer.close()
