"""The checked transport, against the simulator's server and against peers written out byte by byte."""

import asyncio
import errno
import os
import socket
import struct
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager

import numpy as np
import pytest

from impactcell.errors import FieldbusError, LinkError, ModbusExceptionError, ProtocolError
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.registers import WIRE, Words
from impactcell.fieldbus.transports import transport_for
from simulator.faults import Fault, FaultInjector, FaultKind
from simulator.modbus_server import ModbusServer

SILENT_S = 30.0
"""A timeout that no test waits for."""


class Image:
    def __init__(self) -> None:
        self.words = np.arange(65_536).astype(WIRE)
        self.busy = 0
        self.writes: list[tuple[int, list[int]]] = []

    def read(self, table: str, address: int, count: int) -> Words:
        if self.busy:
            self.busy -= 1
            raise BlockingIOError
        if address + count > 65_000:
            raise LookupError(address)
        return self.words[address : address + count]

    def write(self, address: int, words: Words) -> None:
        self.writes.append((address, words.tolist()))
        self.words[address : address + words.size] = words


@asynccontextmanager
async def linked(
    server: ModbusServer, window: int | None = 1, timeout_s: float = SILENT_S, **link: float
) -> AsyncIterator[ModbusClient]:
    client = ModbusClient(
        transport_for(
            ModuleLink(port=server.port, window=window, timeout_s=timeout_s, **link)  # type: ignore[arg-type]
        )
    )
    await client.connect()
    try:
        yield client
    finally:
        await client.close()


Peer = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


@asynccontextmanager
async def peer(behaviour: Peer) -> AsyncIterator[int]:
    """Serve every connection with `behaviour`; yields the port."""
    tasks: set[asyncio.Task[None]] = set()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        tasks.add(task)
        try:
            await behaviour(reader, writer)
            await reader.read()
        except (ConnectionError, asyncio.IncompleteReadError):
            pass
        finally:
            writer.close()
            tasks.discard(task)

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


@pytest.mark.parametrize("window", [1, 3, 16, 64])
@pytest.mark.parametrize(
    ("count", "max_registers"), [(1, 125), (125, 125), (126, 125), (1000, 7), (20_000, 125)]
)
async def test_blocks_arrive_whole(window: int, count: int, max_registers: int) -> None:
    async with (
        ModbusServer(Image()) as server,
        linked(server, window, max_registers=max_registers) as client,
    ):
        words = await client.read(17, count)
        assert np.array_equal(words, np.arange(17, 17 + count))
        assert server.requests == -(-count // max_registers)


@pytest.mark.parametrize("window", [1, 16])
async def test_several_blocks_arrive_in_one_exchange(window: int) -> None:
    async with ModbusServer(Image()) as server, linked(server, window) as client:
        blocks = [client.block(100, 300), client.block(5_000, 7, "input"), client.block(9_000, 126)]
        await client.complete(*blocks)
        for block in blocks:
            assert np.array_equal(block.words(), np.arange(block.address, block.address + block.count))
        await client.complete(*blocks)  # nothing is missing any more
        assert server.requests == 3 + 1 + 2


async def test_a_refused_block_fails_all_that_were_asked_for_with_it() -> None:
    async with ModbusServer(Image()) as server, linked(server, 16) as client:
        good, refused = client.block(100, 300), client.block(65_100, 10)
        with pytest.raises(ModbusExceptionError, match="illegal data address"):
            await client.complete(good, refused)
        await client.complete(good)
        assert np.array_equal(good.words(), np.arange(100, 400))


async def test_many_readers_share_one_window() -> None:
    async with ModbusServer(Image()) as server, linked(server, 4) as client:
        blocks = await asyncio.gather(*(client.read(i * 100, 90 + i) for i in range(50)))
        for i, words in enumerate(blocks):
            assert np.array_equal(words, np.arange(i * 100, i * 100 + 90 + i))


async def test_no_more_requests_in_flight_than_the_window() -> None:
    most = 0

    async def count(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        nonlocal most
        for _ in range(5):
            request = await reader.readexactly(12)
            most = max(most, 1 + len(reader._buffer) // 12)  # type: ignore[attr-defined]
            writer.write(request[:4] + b"\0\x05" + request[6:8] + b"\x02" + request[8:10])

    async with peer(count) as port:
        client = ModbusClient(
            transport_for(ModuleLink(port=port, window=1, max_registers=1, timeout_s=SILENT_S))
        )
        await client.connect()
        assert (await client.read(40, 5)).tolist() == [40, 41, 42, 43, 44]
        await client.close()
    assert most == 1


async def test_writes_use_function_6_and_16_and_are_seen() -> None:
    device = Image()
    async with ModbusServer(device) as server, linked(server) as client:
        await client.write(5, np.array([9], dtype=WIRE))
        await client.write(7, np.array([1, 2, 3], dtype=WIRE))
        assert device.writes == [(5, [9]), (7, [1, 2, 3])]
        assert (await client.read(5, 5)).tolist() == [9, 6, 1, 2, 3]


@pytest.mark.parametrize(
    ("device_id", "address", "name", "code"),
    [(1, 64_990, "illegal data address", 2), (9, 0, "gateway target device failed to respond", 11)],
)
async def test_refusals_have_names_and_leave_the_link_open(
    device_id: int, address: int, name: str, code: int
) -> None:
    async with ModbusServer(Image()) as server, linked(server, 4, device_id=device_id) as client:
        with pytest.raises(ModbusExceptionError, match=name) as caught:
            await client.read(address, 20)
        assert caught.value.code == code
        assert client.connected


async def test_a_busy_device_is_asked_again() -> None:
    device = Image()
    device.busy = 3
    async with ModbusServer(device) as server, linked(server, 4) as client:
        assert np.array_equal(await client.read(0, 1000), np.arange(1000))
    assert server.requests == 8 + 3


async def test_a_device_that_stays_busy_is_an_error_by_name() -> None:
    device = Image()
    device.busy = 10**9
    async with ModbusServer(device) as server, linked(server, timeout_s=2.0) as client:
        with pytest.raises(ModbusExceptionError, match="server device busy"):
            await client.read(0, 10)
        assert client.connected


async def test_a_connection_that_is_reset_is_told_in_words() -> None:
    """It said "[Errno 104] Connection reset by peer", on the page and in the alarm."""

    async def reset(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1)
        without_goodbye = struct.pack("ii", 1, 0)
        writer.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, without_goodbye)
        writer.transport.abort()

    peer = await asyncio.start_server(reset, "127.0.0.1", 0)
    link = ModuleLink(port=peer.sockets[0].getsockname()[1], window=1, timeout_s=SILENT_S)
    client = ModbusClient(transport_for(link))
    async with peer:
        await client.connect()
        with pytest.raises(LinkError) as lost:
            await client.read(0, 1)
        await client.close()
    assert str(lost.value) == f"{link}: connection lost: {os.strerror(errno.ECONNRESET)}"


async def test_a_disconnect_fails_everything_at_once() -> None:
    """Within the timeout of the test, with a link timeout far beyond it."""
    async with ModbusServer(Image()) as server, linked(server, 2) as client:
        server.faults.inject(Fault(FaultKind.DROP))
        reads = [asyncio.ensure_future(client.read(i, 300)) for i in range(3)]
        while server.requests < 2:
            await asyncio.sleep(0)
        server.drop_clients()
        for result in await asyncio.gather(*reads, return_exceptions=True):
            assert isinstance(result, LinkError)
            assert "connection lost" in str(result)
        assert not client.connected
        with pytest.raises(LinkError, match="not connected"):
            await client.read(0, 1)
        server.faults.clear()
        await client.connect()
        assert (await client.read(3, 1)).tolist() == [3]


@pytest.mark.parametrize("kind", [FaultKind.DROP, FaultKind.HALF_OPEN, FaultKind.TRUNCATED])
async def test_silence_closes_the_link_and_the_next_connection_works(kind: FaultKind) -> None:
    async with ModbusServer(Image()) as server, linked(server, timeout_s=4.0) as client:
        server.faults.inject(Fault(kind, remaining=1))
        with pytest.raises(
            LinkError, match=r"no answer to 10 holding registers from 0 within 4000 ms \(timeout_ms\)"
        ):
            await client.read(0, 10)
        assert not client.connected
        await client.connect()
        assert np.array_equal(await client.read(0, 10), np.arange(10))


@pytest.mark.parametrize(
    ("kind", "told"),
    [
        (FaultKind.WRONG_TRANSACTION, "which is not open"),
        (FaultKind.WRONG_UNIT, "an answer from device"),
        (FaultKind.WRONG_FUNCTION, "answered with function"),
        (FaultKind.WRONG_PROTOCOL, "protocol"),
    ],
)
async def test_a_reply_that_is_not_ours_closes_the_link(kind: FaultKind, told: str) -> None:
    async with ModbusServer(Image()) as server, linked(server) as client:
        server.faults.inject(Fault(kind, remaining=1))
        with pytest.raises(ProtocolError, match=told):
            await client.read(0, 10)
        assert not client.connected


async def test_a_reply_filled_up_by_the_whole_of_the_next_one_is_not_used() -> None:
    async def lose_bytes(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        frames = []
        for _ in range(2):
            request = await reader.readexactly(12)
            address, count = struct.unpack(">HH", request[8:])
            data = np.arange(address, address + count).astype(WIRE).tobytes()
            head = request[:4] + struct.pack(">H", 3 + len(data)) + request[6:8] + bytes([len(data)])
            frames.append(head + data)
        writer.write(frames[0][: -len(frames[1])] + frames[1])

    async with peer(lose_bytes) as port:
        client = ModbusClient(transport_for(ModuleLink(port=port, window=4, timeout_s=2.0)))
        await client.connect()
        long, short = await asyncio.gather(client.read(100, 60), client.read(7, 3), return_exceptions=True)
        assert isinstance(long, LinkError)
        assert isinstance(short, LinkError)
        await client.close()


@pytest.mark.parametrize("seed", range(8))
async def test_a_reply_of_the_wrong_length_is_never_used(seed: int) -> None:
    faults = FaultInjector(seed)
    async with ModbusServer(Image(), faults=faults) as server, linked(server, timeout_s=2.0) as client:
        faults.inject(Fault(FaultKind.WRONG_LENGTH, remaining=1))
        with pytest.raises((ProtocolError, LinkError)):
            await client.read(0, 10)
        assert not client.connected


@pytest.mark.parametrize("kind", [FaultKind.JOINED, FaultKind.SPLIT, FaultKind.JITTER])
async def test_legal_but_odd_framing_and_order_are_understood(kind: FaultKind) -> None:
    async with ModbusServer(Image()) as server, linked(server, 8) as client:
        server.faults.inject(Fault(kind, probability=0.5, seconds=0.01))
        assert np.array_equal(await client.read(0, 5000), np.arange(5000))


async def test_a_late_reply_is_not_taken_for_the_answer_to_the_next_request() -> None:
    """As a gateway does it: the late reply comes on the next connection, with the old transaction id."""
    async with ModbusServer(Image()) as server:
        server.faults.inject(Fault(FaultKind.LATE_REPLY, remaining=1, seconds=10.0))
        async with linked(server, timeout_s=2.0) as impatient:
            with pytest.raises(LinkError):
                await impatient.read(1000, 10)
        async with linked(server) as next_one:
            server.faults.inject(Fault(FaultKind.DELAY, remaining=1, seconds=SILENT_S))
            with pytest.raises(ProtocolError, match="which is not open"):
                await next_one.read(0, 10)


async def test_every_attempt_has_a_fresh_transaction_id() -> None:
    seen: list[int] = []

    async def never(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        seen.append(struct.unpack(">H", (await reader.readexactly(12))[:2])[0])

    async with peer(never) as port:
        client = ModbusClient(transport_for(ModuleLink(port=port, timeout_s=4.0)))
        for _ in range(3):
            await client.connect()
            with pytest.raises(LinkError):
                await client.read(0, 10)
        await client.close()
    assert len(set(seen)) == 3


async def test_a_pause_between_requests_is_kept() -> None:
    loop = asyncio.get_running_loop()
    async with ModbusServer(Image()) as server, linked(server, pause_s=0.01) as client:
        started = loop.time()
        await client.read(0, 500)
        assert loop.time() - started >= 3 * 0.01


async def test_nobody_there_is_a_link_error() -> None:
    async with ModbusServer(Image()) as server:
        port = server.port
    client = ModbusClient(transport_for(ModuleLink(port=port)))
    with pytest.raises(LinkError, match=f"127.0.0.1:{port} device 1: no connection"):
        await client.connect()
    await client.close()


async def test_a_cancelled_read_leaves_the_link_usable() -> None:
    async with ModbusServer(Image()) as server, linked(server, 2) as client:
        server.faults.inject(Fault(FaultKind.DELAY, seconds=0.02))
        read = asyncio.ensure_future(client.read(0, 10_000))
        while not server.requests:
            await asyncio.sleep(0)
        read.cancel()
        with pytest.raises(asyncio.CancelledError):
            await read
        server.faults.clear()
        assert np.array_equal(await client.read(7, 300), np.arange(7, 307))


async def test_connecting_twice_keeps_the_connection() -> None:
    async with ModbusServer(Image()) as server, linked(server) as client:
        await client.connect()
        assert len(server.links) == 1


@pytest.mark.parametrize("window", [1, 16])
async def test_no_fault_gets_a_wrong_value_through(window: int) -> None:
    """The small version of the study in tests/benchmarks/fieldbus.py."""
    faults = FaultInjector(seed=window)
    accepted = 0
    async with ModbusServer(Image(), faults=faults) as server:
        client = ModbusClient(transport_for(ModuleLink(port=server.port, window=window, timeout_s=0.1)))
        for kind in FaultKind:
            faults.inject(Fault(kind, probability=0.02, seconds=0.15))
        draw = np.random.default_rng(window)
        for _ in range(80):
            address, count = int(draw.integers(0, 60_000)), int(draw.integers(1, 500))
            try:
                await client.connect()
                words = await client.read(address, count)
            except FieldbusError:
                continue
            accepted += 1
            assert np.array_equal(words, np.arange(address, address + count))
        await client.close()
    assert accepted > 10
    assert sum(faults.happened.values()) > 30
