"""Faulty exchanges, outages and reconnections: what gets through, what is lost, how long it takes."""

import asyncio
import contextlib
import json
import logging
from collections import Counter
from pathlib import Path

import numpy as np
import yaml

from impactcell.errors import FieldbusError
from impactcell.fieldbus.acquisition import ModuleAcquisition
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.registers import RegisterMap
from impactcell.fieldbus.transports import transport_for
from simulator.faults import Fault, FaultInjector, FaultKind
from simulator.modbus_server import ModbusServer
from simulator.scripted import ScriptedDevice
from tests.benchmarks._modbus_peer import Image
from tests.benchmarks.table import Table

MAP = Path(__file__).resolve().parents[2] / "config" / "maps" / "fpga-v1.yaml"
RESULTS = Path(__file__).resolve().parents[2] / "bench-results"
SAMPLES = 2000
MANY, FEW = (0.02, 400), (0.003, 4000)
"""Probability of each fault in a reply, and the longest block: only good ones are used together."""
READERS = [
    (1, MANY),
    (1, MANY),
    (4, MANY),
    (16, MANY),
    (16, MANY),
    (32, MANY),
    (16, FEW),
    (32, FEW),
    (64, FEW),
]


async def faulty(
    window: int, probability: float, longest: int, faults_wanted: int, seed: int
) -> Counter[str]:
    """Read at random from a peer that has every fault; three readers share the link."""
    faults, draw, seen = FaultInjector(seed), np.random.default_rng(seed), Counter[str]()
    async with ModbusServer(Image(), faults=faults) as server:
        client = ModbusClient(transport_for(ModuleLink(port=server.port, window=window, timeout_s=0.05)))
        for kind in FaultKind:
            faults.inject(Fault(kind, probability=probability, seconds=0.07))
        while sum(faults.happened.values()) < faults_wanted:
            blocks = [(int(draw.integers(0, 60_000)), int(draw.integers(1, longest))) for _ in range(3)]
            try:
                await client.connect()
            except FieldbusError:
                seen["failed"] += 1
                continue
            results = await asyncio.gather(*(client.read(*block) for block in blocks), return_exceptions=True)
            for (address, count), result in zip(blocks, results, strict=True):
                if isinstance(result, FieldbusError):
                    seen["failed"] += 1
                elif isinstance(result, BaseException):
                    raise result
                elif np.array_equal(result, np.arange(address, address + count)):
                    seen["right"] += 1
                else:
                    seen["wrong"] += 1
        await client.close()
    seen["faults"] = sum(faults.happened.values())
    for kind, count in faults.happened.items():
        seen[f"fault {kind}"] = count
    return seen


def study(wanted: int) -> Counter[str]:
    """Run until `wanted` faulty exchanges are on file, a line a run, so that it may be interrupted."""
    file = RESULTS / "fieldbus-faults.jsonl"
    file.parent.mkdir(exist_ok=True)
    done: list[dict[str, int]] = []
    if file.exists():
        done = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    while sum(run["faults"] for run in done) < wanted:
        first = len(done)

        async def batch(first: int = first) -> list[Counter[str]]:
            runs = (faulty(window, *kind, 100, first + i) for i, (window, kind) in enumerate(READERS))
            return await asyncio.gather(*runs)

        fresh = [dict(each) for each in asyncio.run(batch())]
        with file.open("a", encoding="utf-8") as out:
            out.writelines(json.dumps(each) + "\n" for each in fresh)
        done += fresh
    total = Counter[str]()
    for each in done:
        total.update(each)
    return total


def make(device: ScriptedDevice, cycles: int = 1) -> None:
    for _ in range(cycles):
        draw = np.random.default_rng(int(device.get("cycle_counter")) + 1)
        samples = {"force": draw.normal(0, 50, SAMPLES), "position": draw.normal(0, 1e-3, SAMPLES // 4)}
        device.complete(
            samples, velocity=0.05, mass=18.9, stroke=0.0015, direction=1, force_rate=1e6, position_rate=1e5
        )


async def outage(registers: RegisterMap, seed: int) -> tuple[float, bool, bool]:
    """One outage of random length.

    Returns the seconds from the link back to the first new cycle, whether exactly the overwritten cycles were
    counted as missed, and whether every capture was whole.
    """
    draw = np.random.default_rng(seed)
    away_s, cycles = float(draw.uniform(0.05, 3.0)), int(draw.integers(0, 40))
    device = ScriptedDevice(registers)
    make(device)
    loop = asyncio.get_running_loop()
    async with (
        ModbusServer(device) as server,
        ModuleAcquisition(
            f"cell-{seed}", ModbusClient(transport_for(ModuleLink(port=server.port, window=16))), registers
        ) as module,
        contextlib.aclosing(module.captures()) as receptions,
    ):
        await anext(receptions)
        await server.close()
        waiting = asyncio.ensure_future(anext(receptions))
        await asyncio.sleep(away_s)
        make(device, cycles + 1)
        await server.start()
        back_s = loop.time()
        received = [await waiting]
        first_s = loop.time() - back_s
        lost = max(0, cycles + 1 - registers.slots)
        received += [await anext(receptions) for _ in range(cycles - lost)]
        numbers = [received.capture.cycle for received in received]
        exact = numbers == list(range(2 + lost, cycles + 3)) and module.status.missed == lost
        whole = True
        for each in received:
            force = each.capture.force
            expected = np.random.default_rng(each.capture.cycle).normal(0, 50, SAMPLES)
            whole &= force is not None and bool(np.allclose(force.values, expected, atol=0.0126))
    return first_s, exact, whole


async def outages(number: int) -> list[tuple[float, bool, bool]]:
    registers = RegisterMap.from_mapping(yaml.safe_load(MAP.read_text(encoding="utf-8")))
    results = []
    for first in range(0, number, 8):
        results += await asyncio.gather(
            *(outage(registers, first + i) for i in range(min(8, number - first)))
        )
    return results


def faults_and_outages(exchanges: int, trials: int) -> Table:
    logging.disable(logging.WARNING)
    try:
        seen = study(exchanges)
        trial = asyncio.run(outages(trials))
    finally:
        logging.disable(logging.NOTSET)
    first_s = np.array([each[0] for each in trial])
    exact, whole = sum(each[1] for each in trial), sum(each[2] for each in trial)
    upper = f"<= {3.0 / max(seen['right'], 1):.1e} a block (95 %)" if not seen["wrong"] else ""
    rows = [
        ["faulty exchanges, of 17 kinds", f">= {exchanges}", f"{seen['faults']}", ""],
        ["blocks read right / refused as errors", "", f"{seen['right']} / {seen['failed']}", ""],
        ["wrong values accepted", "0", f"{seen['wrong']}", upper],
        [
            "link back to first new cycle, default back-off",
            "< 1 s",
            f"{first_s.max():.2f} s at most",
            f"median {np.median(first_s):.2f} s",
        ],
        ["outages after which exactly the overwritten cycles were missed", "all", f"{exact} of {trials}", ""],
        ["outages after which every capture was whole", "all", f"{whole} of {trials}", ""],
    ]
    return Table(
        "Faults and outages on the fieldbus",
        ["what", "bar", "measured", "interval"],
        rows,
        "Faults drawn with fixed seeds, three readers on one link: blocks of up to 400 registers, a third of "
        "all replies faulty, at windows 1, 4, 16 and 32; and of up to 4000, one in twenty, at 16, 32 and 64. "
        "Outages of 0.05-3 s in which 0-39 cycles are made, the ring holding 16; eight at a time.",
    )
