"""Many modules at two full captures a second: CPU and delay of acquisition alone, as cells grow.

As a program it is the modules: `python -m tests.benchmarks._fieldbus_cells N` prints their ports.
"""

import asyncio
import contextlib
import json
import subprocess
import sys
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
from tests.benchmarks._fieldbus_faults import MAP
from tests.benchmarks.table import Table

PERIOD_S = 0.5


def registers() -> RegisterMap:
    return RegisterMap.from_mapping(yaml.safe_load(MAP.read_text(encoding="utf-8")))


async def strike(device: ScriptedDevice, seed: int) -> None:
    """Finish a full cycle every half second, a little irregularly."""
    draw = np.random.default_rng(seed)
    samples = {"force": draw.normal(0, 50, 20_000), "position": draw.normal(0, 1e-3, 4_000)}
    loop = asyncio.get_running_loop()
    due_s = loop.time() + draw.uniform(0.0, PERIOD_S)
    while True:
        await asyncio.sleep(due_s + draw.normal(0.0, 0.002) - loop.time())
        due_s += PERIOD_S
        device.complete(
            samples,
            velocity=0.05,
            mass=18.9,
            stroke=0.0015,
            direction=1,
            force_rate=1e6,
            position_rate=1e5,
            cycle_time=time.time_ns(),
        )


async def modules(number: int) -> None:
    layout = registers()
    async with contextlib.AsyncExitStack() as stack:
        ports = []
        for seed in range(number):
            device = ScriptedDevice(layout)
            ports.append((await stack.enter_async_context(ModbusServer(device))).port)
            stack.callback(asyncio.create_task(strike(device, seed)).cancel)
        print(json.dumps(ports), flush=True)
        await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)


async def follow(port: int, layout: RegisterMap, seconds: float) -> tuple[list[float], int, int]:
    """Delays of the cycles received, their number, and how many were missed."""
    delays_s = []
    async with (
        ModuleAcquisition(
            f"port {port}", ModbusClient(transport_for(ModuleLink(port=port, window=16))), layout
        ) as module,
        contextlib.aclosing(module.captures()) as receptions,
    ):
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                async for received in receptions:
                    delays_s.append(1e-9 * (time.time_ns() - received.capture.time_ns))  # noqa: PERF401
        return delays_s[2:], module.status.received, module.status.missed


async def receive(ports: list[int], seconds: float) -> tuple[list[float], int, int]:
    layout = registers()
    results = await asyncio.gather(*(follow(port, layout, seconds) for port in ports))
    delays = [delay for each in results for delay in each[0]]
    return delays, sum(each[1] for each in results), sum(each[2] for each in results)


def cells(numbers: list[int], seconds: float) -> Table:
    rows = []
    for number in numbers:
        command = [sys.executable, "-m", "tests.benchmarks._fieldbus_cells", str(number)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdin is not None
            assert process.stdout is not None
            ports = json.loads(process.stdout.readline())
            cpu_s = time.process_time()
            delays_s, received, missed = asyncio.run(receive(ports, seconds))
            cpu_s = time.process_time() - cpu_s
            process.stdin.close()
        p50, p99 = (1e3 * float(np.quantile(delays_s, q)) for q in (0.5, 0.99))
        rows.append(
            [
                f"{number}",
                f"{received}",
                f"{missed}",
                f"{100 * cpu_s / seconds:.0f} %",
                f"{p50:.1f} ms",
                f"{p99:.1f} ms",
            ]
        )
    return Table(
        "Acquisition alone, modules at 2 full captures a second each",
        ["cells", "received", "missed (bar 0)", "CPU of one core", "cycle complete to received, p50", "p99"],
        rows,
        f"{seconds:g} s each, window 16, 20 000 force and 4 000 position samples; the modules in a process "
        "of their own.",
    )


if __name__ == "__main__":
    asyncio.run(modules(int(sys.argv[1])))
