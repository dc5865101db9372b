"""Many modules that serve real taps at a fixed rate: `python -m tests.benchmarks._modules N PERIOD_S`.

Captures are full. The taps are those of the simulator's plant; each cycle shows one of them anew.
"""

import asyncio
import contextlib
import json
import sys
import time

import numpy as np
import yaml

from impactcell.fieldbus.registers import RegisterMap
from simulator.modbus_server import ModbusServer
from simulator.plant import Plant, TapInput, simulate_tap
from simulator.scripted import ScriptedDevice
from tests.integration.processes import CONFIG

TAPS = 12
FORCE_HZ, POSITION_HZ = 1_000_000, 20_000
FORCE_SAMPLES, POSITION_SAMPLES = 20_000, 4_000


def taps() -> list[tuple[dict[str, np.ndarray], dict[str, float | str]]]:
    """Samples and header of each tap."""
    draw = np.random.default_rng(1)
    made = []
    for _ in range(TAPS):
        factor = 1.0 + 0.006 * draw.standard_normal()
        plant = Plant(
            6.5e5,
            465.0,
            mu_s=0.2 * factor,
            mu_k=0.152 * factor,
            effects={"viscous_friction": {"viscous_coefficient_n_s_per_m": 85.0}},
        )
        velocity = float(draw.uniform(0.05, 0.09))
        motion = simulate_tap(plant, TapInput(velocity_m_s=velocity, mass_kg=18.9, stroke_m=1.5e-3))
        force_s = np.arange(FORCE_SAMPLES) / FORCE_HZ
        position_s = np.arange(POSITION_SAMPLES) / POSITION_HZ
        samples = {
            "force": motion.force_n(force_s) + draw.normal(0.0, 0.4, FORCE_SAMPLES),
            "position": motion.position_m(position_s) + draw.normal(0.0, 1.5e-6, POSITION_SAMPLES),
        }
        header: dict[str, float | str] = {
            "velocity": velocity,
            "mass": 18.9,
            "stroke": 1.5e-3,
            "direction": 1,
            "force_rate": FORCE_HZ,
            "position_rate": POSITION_HZ,
            "batch_id": "A",
            "peak_force": motion.peak_force_n,
            "sliding_distance": motion.sliding_distance_m,
        }
        made.append((samples, header))
    return made


async def strike(device: ScriptedDevice, made: list, seed: int, period_s: float) -> None:  # type: ignore[type-arg]
    """Finish a cycle every period, a little irregularly."""
    draw = np.random.default_rng(seed)
    loop = asyncio.get_running_loop()
    due_s = loop.time() + draw.uniform(0.0, period_s)
    while True:
        await asyncio.sleep(due_s + draw.normal(0.0, 0.002) - loop.time())
        due_s += period_s
        samples, header = made[int(draw.integers(TAPS))]
        device.complete(samples, **header, cycle_time=time.time_ns())


async def serve(number: int, period_s: float) -> None:
    """Serve until standard input closes; prints the ports."""
    layout = RegisterMap.from_mapping(yaml.safe_load((CONFIG / "maps" / "fpga-v1.yaml").read_text()))
    made = taps()
    async with contextlib.AsyncExitStack() as stack:
        ports = []
        for seed in range(number):
            device = ScriptedDevice(layout)
            ports.append((await stack.enter_async_context(ModbusServer(device))).port)
            stack.callback(asyncio.create_task(strike(device, made, seed, period_s)).cancel)
        print(json.dumps(ports), flush=True)
        await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)


if __name__ == "__main__":
    asyncio.run(serve(int(sys.argv[1]), float(sys.argv[2])))
