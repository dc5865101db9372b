"""Requests in flight as found by trials: up to 64 of a device that queues, one for good of any other."""

import asyncio
import logging
import re
import struct
from collections.abc import Callable

import numpy as np
import pytest

from impactcell.errors import LinkError, ModbusExceptionError
from impactcell.fieldbus.acquisition import ModuleAcquisition
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.probe import probe
from impactcell.fieldbus.registers import RegisterMap
from impactcell.fieldbus.transports import transport_for
from simulator.client_connection import ClientConnection
from simulator.faults import Fault, FaultKind
from simulator.modbus_server import ModbusServer
from simulator.scripted import ScriptedDevice
from tests.unit.fieldbus.test_acquisition import assert_whole, make, running, take
from tests.unit.fieldbus.test_transport import SILENT_S, Image, Peer, linked, peer

REQUEST_BYTES = 12

Misbehaviour = Callable[[list[bytes]], list[bytes] | None]
"""From the requests that came together to the replies; None closes the connection."""


def reply(request: bytes, data_of: bytes | None = None, head_of: bytes | None = None) -> bytes:
    """Give the reply to a request that reads registers, each of which holds its own address."""
    address, count = struct.unpack(">HH", (data_of or request)[8:12])
    data = np.arange(address, address + count).astype(">u2").tobytes()
    head = head_of or request
    return head[:4] + struct.pack(">H", 3 + len(data)) + head[6:8] + bytes([len(data)]) + data


def only_the_first(requests: list[bytes]) -> list[bytes]:
    return [reply(requests[0])]


def closed(requests: list[bytes]) -> list[bytes] | None:
    return None if len(requests) > 1 else [reply(requests[0])]


def newest_first(requests: list[bytes]) -> list[bytes]:
    return [reply(request) for request in reversed(requests)]


def numbers_swapped(requests: list[bytes]) -> list[bytes]:
    return [reply(a, head_of=b) for a, b in zip(requests, reversed(requests), strict=True)]


def newest_number(requests: list[bytes]) -> list[bytes]:
    return [reply(request, head_of=requests[-1]) for request in requests]


def first_answer_again(requests: list[bytes]) -> list[bytes]:
    return [reply(request, data_of=requests[0]) for request in requests]


def serving(misbehaviour: Misbehaviour, together: list[int]) -> Peer:
    async def behave(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while data := await reader.read(65_536):
            data += await reader.readexactly(-len(data) % REQUEST_BYTES)
            requests = [data[at : at + REQUEST_BYTES] for at in range(0, len(data), REQUEST_BYTES)]
            together.append(len(requests))
            replies = misbehaviour(requests)
            if replies is None:
                writer.close()
                return
            writer.write(b"".join(replies))

    return behave


async def test_a_device_that_queues_has_many_in_flight_and_begins_with_one() -> None:
    async with ModbusServer(Image()) as server, linked(server, None) as client:
        assert client.window.size == 1
        assert await client.find_window(100, 20_000)
        assert (client.window.size, server.requests) == (64, 2 + 16 + 64)
        assert str(client.window) == "64, found by trial"
        assert await client.find_window(100, 20_000)
        assert server.requests == 2 + 16 + 64
        assert np.array_equal(await client.read(100, 20_000), np.arange(100, 20_100))
        await client.close()
        await client.connect()
        assert client.window.size == 1


@pytest.mark.parametrize(
    ("count", "size", "requests"),
    [(1, 1, 0), (2, 2, 2), (15, 2, 2), (16, 16, 18), (63, 16, 18), (64, 64, 82)],
)
async def test_as_many_are_tried_as_there_are_registers_to_read(count: int, size: int, requests: int) -> None:
    """Each request of a trial has a length of its own, so that answers out of order are seen."""
    async with ModbusServer(Image()) as server, linked(server, None) as client:
        assert await client.find_window(100, count)
        assert (client.window.size, server.requests) == (size, requests)


@pytest.mark.parametrize(
    ("misbehaviour", "kept", "told"),
    [
        (only_the_first, False, "no answer to .* within 4000 ms"),
        (closed, False, "connection lost"),
        (newest_first, True, "answers come out of order"),
        (numbers_swapped, False, "bytes|length|registers"),
        (newest_number, False, "bytes|length|registers|not open"),
        (first_answer_again, False, "bytes|length|registers"),
    ],
)
async def test_a_device_that_cannot_stand_two_has_one_for_good(
    misbehaviour: Misbehaviour, kept: bool, told: str
) -> None:
    together: list[int] = []
    async with peer(serving(misbehaviour, together)) as port:
        client = ModbusClient(transport_for(ModuleLink(port=port, timeout_s=4.0)))
        await client.connect()
        assert await client.find_window(100, 500) is kept
        together.clear()
        for _ in range(3):
            await client.close()
            await client.connect()
            assert await client.find_window(100, 500)
            assert np.array_equal(await client.read(100, 500), np.arange(100, 600))
        await client.close()
    assert set(together) == {1}
    window = client.window
    assert window.size == 1
    assert str(window) == f"1 for good: {window.given_up}"
    assert re.search(told, window.given_up)


async def test_a_device_that_stands_two_but_not_sixteen_has_one_for_good() -> None:
    async with peer(serving(lambda each: None if len(each) > 4 else [*map(reply, each)], [])) as port:
        client = ModbusClient(transport_for(ModuleLink(port=port, timeout_s=SILENT_S)))
        await client.connect()
        assert not await client.find_window(100, 500)
        await client.close()
        await client.connect()
        assert (client.window.size, client.window.untried) == (1, False)
        await client.close()


def busy_beyond_few(requests: list[bytes]) -> list[bytes]:
    refused = [each[:4] + struct.pack(">H", 3) + each[6:7] + b"\x83\x06" for each in requests[16:]]
    return [*map(reply, requests[:16]), *refused]


@pytest.mark.parametrize(
    ("misbehaviour", "kept"),
    [
        (lambda requests: None if len(requests) > 16 else [*map(reply, requests)], False),
        (lambda requests: [*map(reply, requests[:16])], False),
        (busy_beyond_few, True),
    ],
    ids=["closes", "drops", "is busy"],
)
async def test_a_device_that_stands_sixteen_but_not_more_keeps_sixteen(
    misbehaviour: Misbehaviour, kept: bool
) -> None:
    together: list[int] = []
    async with peer(serving(misbehaviour, together)) as port:
        client = ModbusClient(transport_for(ModuleLink(port=port, timeout_s=SILENT_S)))
        await client.connect()
        assert await client.find_window(100, 500) is kept
        together.clear()
        for _ in range(4):
            await client.close()
            await client.connect()
            assert await client.find_window(100, 500)
            assert str(client.window) == "16, found by trial"
            assert np.array_equal(await client.read(100, 9_000), np.arange(100, 9_100))
        await client.close()
    assert client.window.given_up == ""
    assert max(together) == 16


@pytest.mark.parametrize("pinned", [1, 4])
async def test_a_set_window_is_neither_tried_nor_given_up(pinned: int) -> None:
    async with peer(serving(closed, [])) as port:
        client = ModbusClient(transport_for(ModuleLink(port=port, window=pinned, timeout_s=SILENT_S)))
        for _ in range(4):
            await client.connect()
            assert await client.find_window(100, 500)
            if pinned > 1:
                with pytest.raises(LinkError):
                    await client.read(0, 500)
        await client.close()
    assert (client.window.size, client.window.given_up) == (pinned, "")
    assert str(client.window) == f"{pinned}, as set"


async def test_a_pause_between_requests_leaves_one_in_flight() -> None:
    async with ModbusServer(Image()) as server, linked(server, None, pause_s=0.001) as client:
        assert await client.find_window(0, 500)
        assert str(client.window) == "1, for the pause between requests"


async def test_short_replies_are_tried_with_as_many_as_differ_in_length() -> None:
    async with ModbusServer(Image()) as server, linked(server, None, max_registers=7) as client:
        assert await client.find_window(0, 500)
        assert client.window.size == 2
        assert server.requests == 2


async def test_a_busy_device_is_tried_again_but_not_for_ever() -> None:
    image = Image()
    async with ModbusServer(image) as server, linked(server, None) as client:
        for trial in range(3):
            assert (client.window.size, client.window.given_up) == (1, ""), trial
            image.busy = 1
            assert await client.find_window(0, 500)
        assert "busy where 2 requests are in flight" in client.window.given_up
        assert np.array_equal(await client.read(0, 500), np.arange(500))


async def test_registers_that_cannot_be_read_decide_nothing_at_first() -> None:
    async with ModbusServer(Image()) as server, linked(server, None) as client:
        for _ in range(2):
            assert await client.find_window(64_900, 500)
            assert (client.window.size, client.window.given_up) == (1, "")
        assert await client.find_window(64_000, 500)
        assert client.window.size == 64


async def test_what_was_passed_is_given_up_after_three_connections_lost() -> None:
    """A link that fails proves nothing against a device that has passed; three times in a row does."""
    async with ModbusServer(Image()) as server, linked(server, None) as client:
        for size in (64, 64, 64, 16, 16, 16):
            await client.connect()
            assert await client.find_window(0, 500)
            assert client.window.size == size
            server.faults.inject(Fault(FaultKind.RESET, remaining=1))
            with pytest.raises(LinkError):
                await client.read(0, 500)
            await client.close()
        await client.connect()
        assert "connection lost" in client.window.given_up
        assert (client.window.size, client.window.untried) == (1, False)


async def test_a_thousand_good_replies_clear_a_device() -> None:
    async with ModbusServer(Image()) as server, linked(server, None) as client:
        for _ in range(5):
            await client.connect()
            assert await client.find_window(0, 500)
            assert client.window.size == 64
            for _ in range(7):
                await client.read(0, 20_000)
            server.faults.inject(Fault(FaultKind.RESET, remaining=1))
            with pytest.raises(LinkError):
                await client.read(0, 500)
            await client.close()
        assert client.window.given_up == ""


class OneAtATime(ClientConnection):
    """Closes where a second request comes before the first is answered."""

    def data_received(self, data: bytes) -> None:
        if len(data) > REQUEST_BYTES and data[7] in (3, 4):
            self.abort()
        else:
            super().data_received(data)


async def test_cycles_come_whole_from_a_module_of_one_request_and_it_is_said_once(
    fpga: RegisterMap, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ModbusServer, "connection", OneAtATime)
    device = ScriptedDevice(fpga)
    make(device, 3)
    with caplog.at_level(logging.WARNING):
        async with running(fpga, device, window=None) as (server, module, receptions):
            for number in range(1, 4):
                [received] = await take(receptions, 1)
                assert received.capture.cycle == number
                assert_whole(received)
            server.drop_clients()
            make(device)
            assert_whole((await take(receptions, 1))[0])
            assert module.register_client.modbus.window.size == 1
    said = [
        record.getMessage() for record in caplog.records if "in flight from now on" in record.getMessage()
    ]
    assert len(said) == 1
    assert "connection lost" in said[0]


async def test_cycles_come_whole_with_many_in_flight(fpga: RegisterMap) -> None:
    device = ScriptedDevice(fpga)
    make(device, 3)
    async with running(fpga, device, window=None) as (_, module, receptions):
        for received in await take(receptions, 3):
            assert_whole(received)
        assert module.register_client.modbus.window.size == 64


@pytest.mark.parametrize("one", [False, True])
async def test_probe_says_what_it_found(
    fpga: RegisterMap, one: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if one:
        monkeypatch.setattr(ModbusServer, "connection", OneAtATime)
    device = ScriptedDevice(fpga)
    make(device)
    async with ModbusServer(device) as server:
        client = ModbusClient(transport_for(ModuleLink(port=server.port, timeout_s=SILENT_S)))
        result = await probe(ModuleAcquisition("cell-1", client, fpga))
    assert result.capture is not None
    assert result.capture.cycle == 1
    assert result.window.startswith("1 for good: " if one else "64, found by trial")


async def test_a_refused_reading_in_flight_with_others_gives_nothing_up() -> None:
    async with ModbusServer(Image()) as server, linked(server, None) as client:
        await client.find_window(0, 500)
        with pytest.raises(ModbusExceptionError):
            await client.read(64_900, 500)
        assert client.window.size == 64
