"""Faults that last: another firmware behind an open connection, a busy window, a slow gateway."""

import asyncio
import itertools
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import numpy as np
import pytest

from impactcell.errors import LinkError
from impactcell.fieldbus.cycles import capture_reader
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.registers import WIRE, RegisterMap, Words
from impactcell.fieldbus.transports import transport_for
from simulator.modbus_server import ModbusServer
from simulator.scripted import ScriptedDevice
from tests.unit.fieldbus.test_acquisition import assert_whole, make, running, take


async def test_another_map_version_under_an_open_connection_is_noticed_before_the_next_cycle(
    fpga: RegisterMap,
) -> None:
    """A gateway keeps the connection while the module behind it gets another firmware."""
    device = ScriptedDevice(fpga)
    make(device)
    async with running(fpga, device) as (server, module, receptions):
        await take(receptions, 1)
        connections = len(server.links)
        device.put("map_version", 2)
        make(device)
        coming = asyncio.ensure_future(anext(receptions))  # type: ignore[arg-type]
        while module.status.connected:
            await asyncio.sleep(0)
        assert connections == 1
        assert "register map_version (16) shows 2, map fpga-v1 expects 1" in module.status.reason
        assert module.status.received == 1
        device.put("map_version", 1)
        assert_whole(await coming)


@pytest.mark.parametrize("readings", [5, 12])
async def test_a_cycle_that_the_ring_still_holds_is_not_given_up_after_five_readings(
    fpga: RegisterMap, monkeypatch: pytest.MonkeyPatch, readings: int
) -> None:
    """Another client selects slots meanwhile: so many readings are of no use, and then one is."""
    monkeypatch.setattr(capture_reader, "_LONGEST_PAUSE_S", 0.002)
    device = ScriptedDevice(fpga)
    make(device, 2)
    remaining = itertools.count(readings, -1)
    address = fpga["force"].address + 7

    def flip() -> None:
        if next(remaining) > 0:
            device.image[address] = int(device.image[address]) ^ 0x40
            device.on_read += [(fpga["window_sequence_after"].address, restore), (address, flip)]

    def restore() -> None:
        device.image[address] = int(device.image[address]) ^ 0x40

    device.on_read.append((address, flip))
    async with running(fpga, device, window=1) as (_, module, receptions):
        for received in await take(receptions, 2):
            assert_whole(received)
        assert (module.status.unreadable, module.status.discarded) == (0, readings)


async def test_a_capture_that_is_damaged_for_good_costs_no_cycle_behind_it(
    fpga: RegisterMap, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(capture_reader, "_LONGEST_PAUSE_S", 0.002)
    device = ScriptedDevice(fpga)
    make(device, capture_crc32=12345)
    make(device, fpga.slots - 1)
    async with running(fpga, device) as (_, module, receptions):
        received = await take(receptions, fpga.slots)
        assert [each.capture.cycle for each in received] == list(range(1, fpga.slots + 1))
        assert (module.status.unreadable, module.status.discarded, module.status.missed) == (1, 5, 0)


async def test_a_capture_that_is_damaged_for_good_is_given_up_also_where_nothing_waits_behind_it(
    fpga: RegisterMap, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(capture_reader, "_LONGEST_PAUSE_S", 0.002)
    device = ScriptedDevice(fpga)
    make(device, capture_crc32=12345)
    async with running(fpga, device) as (_, module, receptions):
        [received] = await take(receptions, 1)
        assert received.capture.force is None
        assert module.status.discarded == 16


def fail_window(server: ModbusServer, how: str, is_failing: Callable[[], bool]) -> None:
    """Let readings of the window fail while `is_failing`, the status block being answered as ever."""
    answer = server.answer

    def answer_or_fail(unit: int, pdu: bytes) -> bytes | None:
        if pdu[0] == 3 and int.from_bytes(pdu[1:3]) >= 256 and is_failing():
            if how == "exception 4":
                return bytes((0x83, 4))
            server.drop_clients()
            return None
        return answer(unit, pdu)

    server.answer = answer_or_fail  # type: ignore[method-assign]


FAILS = pytest.mark.parametrize("how", ["exception 4", "reset"])


@FAILS
async def test_a_window_that_fails_for_seconds_costs_no_cycle_and_few_connections(
    fpga: RegisterMap, how: str
) -> None:
    device = ScriptedDevice(fpga)
    make(device, 6)
    async with running(fpga, device, window=1) as (server, module, receptions):
        loop = asyncio.get_running_loop()
        over_s = loop.time() + 2.5
        fail_window(server, how, lambda: loop.time() < over_s)
        received = await take(receptions, 6)
        assert [each.capture.cycle for each in received] == list(range(1, 7))
        for each in received:
            assert_whole(each)
        assert (module.status.unreadable, module.status.missed) == (0, 0)
        assert module.status.reconnects < 20


@FAILS
async def test_a_full_ring_is_not_thrown_away_while_its_window_fails(fpga: RegisterMap, how: str) -> None:
    device = ScriptedDevice(fpga)
    make(device, fpga.slots)
    async with running(fpga, device, window=1) as (server, _, receptions):
        loop = asyncio.get_running_loop()
        over_s = loop.time() + 1.5
        fail_window(server, how, lambda: loop.time() < over_s)
        for each in await take(receptions, fpga.slots):
            assert_whole(each)


@FAILS
@pytest.mark.parametrize(("made", "least_s", "most_s"), [(1, 5.0, 20.0), (16, 1.5, 5.0)])
async def test_a_cycle_that_the_link_never_carries_is_given_up_before_it_costs_others(
    fpga: RegisterMap, how: str, made: int, least_s: float, most_s: float
) -> None:
    """After some ten seconds, or sooner where the ring is about to overwrite what lies behind it."""
    device = ScriptedDevice(fpga)
    make(device, made)
    async with running(fpga, device, window=1) as (server, module, receptions):
        loop = asyncio.get_running_loop()
        fail_window(server, how, lambda: device.get("window_cycle") == 1)
        began_s = loop.time()
        [bad] = await take(receptions, 1)
        assert least_s < loop.time() - began_s < most_s
        assert (bad.cycle_id.cycle, bad.capture.force) == (1, None)
        assert "cell-1: cycle 1 could not be read: the link failed each time: " in bad.faults[0]
        for each in await take(receptions, made - 1):
            assert_whole(each)
        assert (module.status.unreadable, module.status.missed) == (1, 0)


@pytest.mark.slow
async def test_what_is_read_anew_after_each_fault_gets_no_further(fpga: RegisterMap) -> None:
    """Without a CRC nothing is kept of a reading that was interrupted, however far it came."""
    registers = {name: register for name, register in fpga.registers.items() if name != "capture_crc32"}
    layout = RegisterMap(fpga.name, registers)
    device = ScriptedDevice(layout)
    make(device)
    async with running(layout, device, window=1) as (server, module, receptions):
        real, address = device.read, layout["force"].address + 2000

        def failing(table: str, first: int, count: int) -> Words:
            if first <= address < first + count and device.get("window_cycle") == 1:
                server.drop_clients()
            return real(table, first, count)

        device.read = failing  # type: ignore[method-assign]
        [bad] = await take(receptions, 1)
        assert "the link failed each time" in bad.faults[0]
        make(device)
        assert_whole((await take(receptions, 1))[0])
        assert module.status.unreadable == 1


class OneByOne(asyncio.Protocol):
    """A gateway before a serial line: every reply takes its time, one after the other."""

    def __init__(self, reply_s: float) -> None:
        self._reply_s = reply_s
        self._loop = asyncio.get_running_loop()
        self._line_free_s = 0.0
        self._replies: list[asyncio.TimerHandle] = []

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport

    def data_received(self, data: bytes) -> None:
        for at in range(0, len(data), 12):
            request = data[at : at + 12]
            first, count = int.from_bytes(request[8:10]), int.from_bytes(request[10:12])
            words: Words = np.arange(first, first + count).astype(WIRE)
            head = request[:4] + (3 + 2 * count).to_bytes(2) + request[6:8] + bytes([2 * count])
            self._line_free_s = max(self._loop.time(), self._line_free_s) + self._reply_s
            reply = head + words.tobytes()
            self._replies.append(self._loop.call_at(self._line_free_s, self._transport.write, reply))

    def connection_lost(self, exc: Exception | None) -> None:
        for reply in self._replies:
            reply.cancel()


@asynccontextmanager
async def gateway(reply_s: float, timeout_s: float) -> AsyncIterator[ModbusClient]:
    """A client with 16 requests in flight to such a gateway."""
    loop = asyncio.get_running_loop()
    async with await loop.create_server(lambda: OneByOne(reply_s), "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        client = ModbusClient(
            transport_for(ModuleLink(port=port, window=16, max_registers=10, timeout_s=timeout_s))
        )
        await client.connect()
        try:
            yield client
        finally:
            await client.close()


async def test_a_window_of_requests_that_are_answered_one_after_the_other_is_waited_for() -> None:
    """16 requests, each answered in time, the last after a timeout."""
    async with gateway(0.06, 0.8) as client:
        assert (await client.read(0, 160)).tolist() == list(range(160))


async def test_a_timeout_says_how_many_requests_were_in_flight() -> None:
    async with gateway(60.0, 0.05) as client:
        with pytest.raises(LinkError, match=r"within 50 ms \(timeout_ms\), of 16 in flight \(window 16\)"):
            await client.read(0, 160)
