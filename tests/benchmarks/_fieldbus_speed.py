"""20 000 registers by our client, by pymodbus's, and by bare exchanges of the same bytes."""

import asyncio
import contextlib
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


async def ours(port: int, window: int) -> tuple[Run, Callable[[], Awaitable[None]]]:
    client = ModbusClient(transport_for(ModuleLink(port=port, window=window, timeout_s=30.0)))
    await client.connect()

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
    """Wall and CPU seconds of the client for each way, the ways taking turns."""
    ways = {
        "ours, window 16": await ours(ports["simulator"], 16),
        "ours, window 1": await ours(ports["simulator"], 1),
        "bare, window 16": await bare(ports["bare"], 16, together=False),
        "bare, window 16, bytes only counted": await bare(ports["counted"], 16, together=True),
        "bare, window 1": await bare(ports["bare"], 1, together=False),
        "pymodbus client and server": await theirs(ports["pymodbus"]),
    }
    taken: dict[str, tuple[list[float], list[float]]] = {name: ([], []) for name in ways}
    for number in range(rounds + 2):
        for name, (run, _) in ways.items():
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

    faster = wall["pymodbus client and server"] / wall["ours, window 16"]
    over = wall["ours, window 16"] / wall["bare, window 16"]
    rows = [
        [f"20 000 registers, {name}", "", f"{1e3 * np.median(values):.2f} ms", interval(1e3 * values, " ms")]
        for name, values in wall.items()
    ]
    over_counted = wall["ours, window 16"] / wall["bare, window 16, bytes only counted"]
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
        f"{rounds} rounds, the ways taking turns in one run; loopback, client and server in processes of "
        "their own. Bare: message by message; only counted: the whole of each read answered by one write.",
    )
