"""Every transport beside the others: faults, speed, a serial line, a gateway shared by eight devices."""

import asyncio
import logging
import tempfile
from collections import Counter
from pathlib import Path
from typing import Final

import numpy as np

from impactcell.errors import FieldbusError
from impactcell.fieldbus.link import ModuleLink, SerialLine
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.transports import Transports, transport_for
from simulator.faults import Fault, FaultInjector, FaultKind
from simulator.rtu_over_tcp import RtuOverTcpServer
from simulator.serial_line import SerialServer, pace_of
from tests.benchmarks.chaos_transports import GRACE_S
from tests.benchmarks.table import Table
from tests.transports import KINDS, Image, connected
from tests.virtual_time import run_virtually

_TIMEOUT_S: Final = 0.05
_LATE_S: Final = 0.07
"""Between once and twice the timeout: later than that, RTU has no defence (see `CheckedPymodbus`)."""
_FAULTY_REPLIES: Final = 1000
"""Of each transport: 0 wrong of them says less than 0.3 % at 95 %."""
_UNITS: Final = 8
_REPLY_S: Final = 0.02


async def _faulty(kind: str, wanted: int, directory: Path) -> Counter[str]:
    """Read at random from a peer that has every fault, until so many have happened."""
    faults, draw, seen = FaultInjector(1), np.random.default_rng(1), Counter[str]()
    for fault in FaultKind:
        faults.inject(Fault(fault, probability=0.02, seconds=_LATE_S))
    async with connected(kind, Image(), directory, faults, timeout_s=_TIMEOUT_S, window=4) as (
        server,
        client,
    ):
        while sum(faults.happened.values()) < wanted:
            address, count = int(draw.integers(0, 60_000)), int(draw.integers(1, 300))
            try:
                await client.connect()
                words = await client.read(address, count)
            except FieldbusError:
                seen["failed"] += 1
                for link in server.links:  # what was half open is repaired
                    link._mute = False
                continue
            seen["right" if np.array_equal(words, np.arange(address, address + count)) else "wrong"] += 1
    seen["faults"] = sum(faults.happened.values())
    return seen


async def _request_s(kind: str, requests: int, directory: Path) -> float:
    """Mean time of a request for 125 registers."""
    loop = asyncio.get_running_loop()
    async with connected(kind, Image(), directory) as (_, client):
        await client.read(0, 1250)
        started_s = loop.time()
        await client.read(0, 125 * requests)
        return (loop.time() - started_s) / requests


async def _on_line(requests: int) -> tuple[float, float]:
    """Mean time of a request for 125 registers at 115 200 baud, and what its characters alone take."""
    loop = asyncio.get_running_loop()
    async with SerialServer(Image(), pace=pace_of(115_200)) as server:
        serial = SerialLine(server.device_file, 115_200, parity="N", stop_bits=2)
        client = ModbusClient(transport_for(ModuleLink(transport="rtu", serial=serial, timeout_s=2.0)))
        await client.connect()
        started_s = loop.time()
        await client.read(0, 125 * requests)
        taken_s = (loop.time() - started_s) / requests
        await client.close()
    return taken_s, (8 + 255) * serial.character_s


async def _shares(seconds: float) -> Counter[int]:
    """Requests answered to each of eight devices that want all they can get, in blocks of different size."""
    loop, answered = asyncio.get_running_loop(), Counter[int]()
    faults = FaultInjector(1)
    faults.inject(Fault(FaultKind.DELAY, seconds=_REPLY_S))
    server = RtuOverTcpServer(Image(), faults=faults)
    async with server:
        for unit in range(1, _UNITS + 1):
            server.devices[unit] = server.device
        links = [
            ModuleLink(port=server.port, device_id=unit, transport="rtu_over_tcp", timeout_s=2.0)
            for unit in range(1, _UNITS + 1)
        ]
        transports = Transports(links)
        clients = [ModbusClient(transports.transport_for(link)) for link in links]
        end_s = loop.time() + seconds

        async def read(client: ModbusClient, size: int) -> None:
            await client.connect()
            while loop.time() < end_s:
                await client.read(0, size)
                answered[client.link.device_id] += -(-size // 125)

        sizes = [10, 125, 250, 500, 10, 125, 250, 500]
        await asyncio.gather(*map(read, clients, sizes))
        for client in clients:
            await client.close()
    return answered


def tables(*, quick: bool = False) -> list[Table]:
    """Faults; speed; the shared gateway."""
    requests, seconds = (40, 6.0) if quick else (400, 60.0)
    logging.disable(logging.ERROR)
    with tempfile.TemporaryDirectory() as name:
        directory = Path(name)
        chaos = {kind: run_virtually(_faulty(kind, _FAULTY_REPLIES, directory), GRACE_S) for kind in KINDS}
        speed = {kind: asyncio.run(_request_s(kind, requests, directory)) for kind in KINDS}
    line_s, floor_s = asyncio.run(_on_line(20 if quick else 100))
    shares = asyncio.run(_shares(seconds))
    logging.disable(logging.NOTSET)
    fair = sum(shares.values()) / _UNITS
    unfair = max(abs(shares[unit] / fair - 1.0) for unit in range(1, _UNITS + 1))
    return [
        Table(
            "Faults on every transport",
            ["transport", "faulty replies", "reads right", "reads failed by name", "reads wrong (bar 0)"],
            [
                [kind, *(str(seen[key]) for key in ("faults", "right", "failed", "wrong"))]
                for kind, seen in chaos.items()
            ],
            f"{len(FaultKind)} kinds, each in 2 % of the replies, one seed, virtual time; blocks of up to "
            "300 registers. "
            f"Late replies come {1e3 * _LATE_S:.0f} ms late with a timeout of {1e3 * _TIMEOUT_S:.0f} ms; "
            "what comes later than twice the timeout is not in it: RTU cannot know it.",
        ),
        Table(
            "A request for 125 registers",
            ["transport", "measured", "bar"],
            [
                *([kind, f"{1e3 * taken_s:.2f} ms", ""] for kind, taken_s in speed.items()),
                [
                    "rtu at 115 200 baud",
                    f"{1e3 * line_s:.1f} ms",
                    f"characters alone: {1e3 * floor_s:.1f} ms",
                ],
            ],
            "One request in flight, client and simulator in one process; a serial line takes no time but in "
            "the last row, where it takes that of its characters. No hardware.",
        ),
        Table(
            "Eight devices behind one gateway, 20 ms a reply",
            ["what", "bar", "measured"],
            [
                ["requests a device", "", ", ".join(str(shares[unit]) for unit in range(1, _UNITS + 1))],
                ["farthest from a fair share", "10 %", f"{100 * unfair:.1f} %"],
                ["line in use", "", f"{100 * sum(shares.values()) * _REPLY_S / seconds:.0f} %"],
            ],
            f"{seconds:.0f} s over RTU over TCP; blocks of 10 to 500 registers, asked for again at once.",
        ),
    ]
