"""The fieldbus: speed beside pymodbus and a bare exchange, faults, outages, cost of a full capture."""

import asyncio
import contextlib
import logging
import time

import numpy as np
import yaml

from impactcell.fieldbus.acquisition import ModuleAcquisition
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.registers import RegisterMap
from impactcell.fieldbus.transports import transport_for
from simulator.modbus_server import ModbusServer
from simulator.scripted import ScriptedDevice
from tests.benchmarks._fieldbus_cells import cells
from tests.benchmarks._fieldbus_faults import MAP, faults_and_outages
from tests.benchmarks._fieldbus_speed import speed
from tests.benchmarks.table import Table


async def _captures(number: int) -> tuple[float, float]:
    """CPU seconds of one full capture, client and server together, and client alone by difference."""
    registers = RegisterMap.from_mapping(yaml.safe_load(MAP.read_text(encoding="utf-8")))
    device = ScriptedDevice(registers)
    draw = np.random.default_rng(1)
    samples = {"force": draw.normal(0, 50, 20_000), "position": draw.normal(0, 1e-3, 4_000)}
    taken: list[float] = []
    async with (
        ModbusServer(device) as server,
        ModuleAcquisition(
            "cell", ModbusClient(transport_for(ModuleLink(port=server.port, window=16))), registers
        ) as module,
        contextlib.aclosing(module.captures()) as receptions,
    ):
        for _ in range(number):
            device.complete(
                samples,
                velocity=0.05,
                mass=18.9,
                stroke=0.0015,
                direction=1,
                force_rate=1e6,
                position_rate=1e5,
            )
            requests, cpu = server.requests, time.process_time()
            await anext(receptions)
            taken.append(time.process_time() - cpu)
        requests = server.requests - requests
    return float(np.median(taken)), float(requests)


def tables(*, quick: bool = False) -> list[Table]:
    """Speed; faults and outages; cost of a full capture."""
    logging.disable(logging.WARNING)
    cpu_s, requests = asyncio.run(_captures(20 if quick else 100))
    logging.disable(logging.NOTSET)
    capture = Table(
        "One full capture (20 000 force and 4 000 position samples)",
        ["what", "bar", "measured", "interval"],
        [
            ["requests", "", f"{requests:.0f}", ""],
            ["CPU, service's and simulator's side together", "", f"{1e3 * cpu_s:.2f} ms", ""],
            ["24 cells at 2 a second, share of one core", "", f"{100 * 48 * cpu_s:.0f} %", ""],
        ],
        "Window 16, CRC checked, decoded to SI; client and server in one process.",
    )
    return [
        speed(10 if quick else 60),
        capture,
        cells([1, 4] if quick else [1, 4, 8, 16, 24], 4.0 if quick else 20.0),
        faults_and_outages(600 if quick else 10_000, 8 if quick else 64),
    ]


if __name__ == "__main__":
    for table in tables():
        print(table.markdown())
