"""20 000 registers by our client, by pymodbus's, and by bare exchanges of the same bytes."""

import asyncio
import contextlib
import struct
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable, Iterator

import numpy as np
from pymodbus.client import AsyncModbusTcpClient

from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.transports import transport_for
from tests.benchmarks._modbus_peer import REPLY
from tests.benchmarks.table import Table

REGISTERS, PER_REQUEST = 20_000, 125
REQUESTS = REGISTERS // PER_REQUEST
REQUEST = bytes([0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, PER_REQUEST])

Run = Callable[[], Awaitable[None]]


@contextlib.contextmanager
def peer(kind: str) -> Iterator[int]:
    command = [sys.executable, "-m", "tests.benchmarks._modbus_peer", kind]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        yield int(process.stdout.readline())
        process.stdin.close()


class BareExchange(asyncio.Protocol):
    """Keeps `window` requests in flight and looks at no byte: each reply's arrival sends the next request."""

    def __init__(self, window: int, *, together: bool) -> None:
        self.window = window
        self.together = together

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport

    async def run(self) -> None:
        self.done = asyncio.get_running_loop().create_future()
        self.sent, self.received = self.window, 0
        self.transport.write(REQUEST * self.window)
        await self.done

    def data_received(self, data: bytes) -> None:
        answered = self.received // len(REPLY)
        self.received += len(data)
        fresh = min(self.received // len(REPLY) - answered, REQUESTS - self.sent)
        self.sent += fresh
        if self.together and fresh:
            self.transport.write(REQUEST * fresh)
        elif not self.together:
            for _ in range(fresh):
                self.transport.write(REQUEST)
        if self.received == REQUESTS * len(REPLY):
            self.done.set_result(None)


class CheckedExchange(asyncio.Protocol):
    """Keeps `window` requests in flight, checks the header of every reply, and keeps its registers.

    The replies that came in one read are checked together and answered by one write.
    """

    def __init__(self, window: int) -> None:
        self.window = window

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport

    async def run(self) -> None:
        self.done = asyncio.get_running_loop().create_future()
        self.sent = self.answered = 0
        self.held, self.words = b"", bytearray()
        self.send(self.window)
        await self.done
        words = np.frombuffer(self.words, ">u2")
        assert words[0] == 100
        assert words[-1] == 20_099

    def send(self, number: int) -> None:
        """Ask for the next `number` blocks, numbered from 0."""
        last = min(self.sent + number, REQUESTS)
        self.transport.write(
            b"".join(
                struct.pack(">HHHBBHH", i, 0, 6, 1, 3, 100 + i * PER_REQUEST, PER_REQUEST)
                for i in range(self.sent, last)
            )
        )
        self.sent = last

    def data_received(self, data: bytes) -> None:
        self.held += data
        replies = len(self.held) // len(REPLY)
        for start in range(0, replies * len(REPLY), len(REPLY)):
            header = struct.unpack_from(">HHHBBB", self.held, start)
            assert header == (self.answered, 0, len(REPLY) - 6, 1, 3, 2 * PER_REQUEST), header
            self.words += self.held[start + 9 : start + len(REPLY)]
            self.answered += 1
        self.held = self.held[replies * len(REPLY) :]
        if self.answered == REQUESTS:
            self.done.set_result(None)
        elif replies and self.sent < REQUESTS:
            self.send(replies)


async def checked(port: int, window: int) -> tuple[Run, Callable[[], Awaitable[None]]]:
    loop = asyncio.get_running_loop()
    transport, exchange = await loop.create_connection(lambda: CheckedExchange(window), "127.0.0.1", port)

    async def close() -> None:
        transport.abort()

    return exchange.run, close


async def ours(port: int, window: int | None) -> tuple[Run, Callable[[], Awaitable[None]]]:
    """Read with our client; None: at its default settings."""
    link = ModuleLink(port=port) if window is None else ModuleLink(port=port, window=window, timeout_s=30.0)
    client = ModbusClient(transport_for(link))
    await client.connect()
    assert await client.find_window(100, REGISTERS)  # as the service does before it reads a capture

    async def run() -> None:
        words = await client.read(100, REGISTERS)
        assert words[0] == 100
        assert words[-1] == 20_099

    return run, client.close


async def theirs(port: int) -> tuple[Run, Callable[[], Awaitable[None]]]:
    client = AsyncModbusTcpClient("127.0.0.1", port=port)
    assert await client.connect()

    async def run() -> None:
        registers: list[int] = []
        for start in range(0, REGISTERS, PER_REQUEST):
            reply = await client.read_holding_registers(100 + start, count=PER_REQUEST, device_id=1)
            registers += reply.registers
        assert np.array(registers, dtype=np.int16).size == REGISTERS

    async def close() -> None:
        client.close()

    return run, close


async def bare(port: int, window: int, *, together: bool) -> tuple[Run, Callable[[], Awaitable[None]]]:
    loop = asyncio.get_running_loop()
    transport, exchange = await loop.create_connection(
        lambda: BareExchange(window, together=together), "127.0.0.1", port
    )

    async def close() -> None:
        transport.abort()

    return exchange.run, close


async def measure(ports: dict[str, int], rounds: int) -> dict[str, tuple[list[float], list[float]]]:
    """Wall and CPU seconds of the client for each way, the ways taking turns in ever another order."""
    ways = {
        "ours, window 16": await ours(ports["simulator"], 16),
        "ours, default settings": await ours(ports["simulator"], None),
        "every frame checked, window 16, same server": await checked(ports["simulator"], 16),
        "pymodbus client, same server": await theirs(ports["simulator"]),
        "bare, window 16": await bare(ports["bare"], 16, together=False),
        "bare, window 16, bytes only counted": await bare(ports["counted"], 16, together=True),
        "bare, window 1": await bare(ports["bare"], 1, together=False),
        "pymodbus client and server": await theirs(ports["pymodbus"]),
    }
    taken: dict[str, tuple[list[float], list[float]]] = {name: ([], []) for name in ways}
    draw = np.random.default_rng(1)
    for number in range(rounds + 2):
        for name in draw.permutation(list(ways)):  # what runs behind a slow one finds the caches empty
            run, _ = ways[name]
            wall, cpu = time.perf_counter(), time.process_time()
            await run()
            if number >= 2:  # the first ones warm up
                taken[name][0].append(time.perf_counter() - wall)
                taken[name][1].append(time.process_time() - cpu)
    for _, close in ways.values():
        await close()
    return taken


def speed(rounds: int) -> Table:
    with contextlib.ExitStack() as stack:
        ports = {
            kind: stack.enter_context(peer(kind)) for kind in ("simulator", "bare", "counted", "pymodbus")
        }
        taken = asyncio.run(measure(ports, rounds))
    wall = {name: np.array(walls) for name, (walls, _) in taken.items()}
    cpu = {name: 1e6 * np.array(cpus) / REQUESTS for name, (_, cpus) in taken.items()}

    def interval(values: np.ndarray, unit: str = "") -> str:
        return f"{values.min():.3g}-{np.quantile(values, 0.9):.3g}{unit}"

    def ratio(values: np.ndarray) -> tuple[str, str]:
        return f"{np.median(values):.2f} x", interval(values)

    faster = wall["pymodbus client and server"] / wall["ours, window 16"]
    over = wall["ours, window 16"] / wall["bare, window 16"]
    rows = [
        [f"20 000 registers, {name}", "", f"{1e3 * np.median(values):.2f} ms", interval(1e3 * values, " ms")]
        for name, values in wall.items()
    ]
    over_counted = wall["ours, window 16"] / wall["bare, window 16, bytes only counted"]
    default, checked_wall = (
        wall["ours, default settings"],
        wall["every frame checked, window 16, same server"],
    )
    same = wall["pymodbus client, same server"]
    rows += [
        ["default settings over every frame checked", "<= 1.1", *ratio(default / checked_wall)],
        ["window 16 over every frame checked", "", *ratio(wall["ours, window 16"] / checked_wall)],
        ["default settings faster than pymodbus client, same server", ">= 15", *ratio(same / default)],
        ["window 16 faster than pymodbus client, same server", "", *ratio(same / wall["ours, window 16"])],
    ]
    rows += [
        ["faster than pymodbus, window 16", ">= 6", f"{np.median(faster):.1f} x", interval(faster)],
        ["over the same-window bare exchange", "<= 2", f"{np.median(over):.2f} x", interval(over)],
        ["over one that only counts bytes", "", f"{np.median(over_counted):.2f} x", interval(over_counted)],
    ]
    rows += [
        [
            f"CPU of the client per request of 125, {name}",
            "<= 20 µs" if name == "ours, window 16" else "",
            f"{np.median(values):.1f} µs",
            interval(values, " µs"),
        ]
        for name, values in cpu.items()
    ]
    return Table(
        "Reading 20 000 registers over Modbus TCP",
        ["what", "bar", "measured", "least to 90 %"],
        rows,
        f"{rounds} rounds, the ways in another order in each; loopback, client and server in processes of "
        "their own. Bare: message by message; only counted: the whole of each read answered by one write. "
        "Every frame checked: numbers, lengths and function of each reply compared, its registers kept.",
    )
