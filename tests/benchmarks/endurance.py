"""100 000 cycles through a cell's worker and journal: memory, and the file against its retention."""

import asyncio
import multiprocessing
import resource
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import psutil

from impactcell.journal.retention import Retention
from impactcell.journal.store import Journal
from impactcell.physics import TapInput, simulate_tap
from impactcell.records import Capture, Channel, PositioningState, uniform_times
from impactcell.service.factory import cell_design
from impactcell.service.worker import CellWorker
from impactcell.settings import read_cell
from tests.benchmarks.table import Table
from tests.integration.processes import CONFIG

CYCLES = 100_000
SETTLED = 0.1
"""Share of the cycles after which memory counts."""
FORCE_HZ, POSITION_HZ = 20_000.0, 4_000.0
KEEP = Retention(days=0.5, captures_days=0.1, max_size_bytes=32 * 2**20)


def captures() -> list[Capture]:
    """Some taps with noise, few samples: what grows grows with the cycles, not with the samples."""
    draw = np.random.default_rng(1)
    design = cell_design(read_cell(CONFIG / "cells" / "prototype.yaml"))
    made = []
    for velocity in draw.uniform(0.05, 0.09, 16):
        motion = simulate_tap(design.model.plant, TapInput(float(velocity), 18.9, 1.5e-3))
        force_s, position_s = uniform_times(0.0, FORCE_HZ, 400), uniform_times(0.0, POSITION_HZ, 800)
        force = motion.sample(force_s).force_n + draw.normal(0.0, 0.4, 400)
        position = motion.sample(position_s).position_m + draw.normal(0.0, 1.5e-6, 800)
        made.append(
            Capture(
                0,
                float(velocity),
                18.9,
                Channel(force_s, np.rint(force / 0.025) * 0.025, resolution=0.025),
                Channel(position_s, np.rint(position / 1e-9) * 1e-9, resolution=1e-9),
                stroke_m=1.5e-3,
                batch_id="A",
            )
        )
    return made


@dataclass(frozen=True)
class Endured:
    """What a run came to: memory (MB) at points along the way, the file, and the processor time a cycle."""

    memory_mb: list[float]
    file_bytes: int
    held: int
    cpu_s: float


async def endure(directory: Path, cycles: int) -> Endured:
    """Run so many cycles, and say every fiftieth of the way how it stands."""
    design = cell_design(read_cell(CONFIG / "cells" / "prototype.yaml"))
    path = directory / "cell.sqlite"
    worker = CellWorker(design, Journal(path, design.name), KEEP)
    await worker.warm_up()
    made, process = captures(), psutil.Process()
    memory: list[float] = []
    began_s = time.process_time()
    for cycle in range(1, cycles + 1):
        capture = replace(made[cycle % len(made)], cycle=cycle, session=1, time_ns=10**18 + cycle * 10**9)
        await worker.process(capture, PositioningState(), None)
        if cycle % (cycles // 50) == 0:
            memory.append(process.memory_info().rss / 2**20)
            size = path.stat().st_size / 2**20
            print(f"endurance: {cycle} cycles, {memory[-1]:.1f} MB, file {size:.1f} MB", file=sys.stderr)
    cpu_s = (time.process_time() - began_s) / cycles
    await worker.close()
    with Journal(path, None, read_only=True) as journal:
        return Endured(memory, path.stat().st_size, journal.count(), cpu_s)


def endured(cycles: int) -> Endured:
    """Run so many cycles in a directory of its own."""
    with tempfile.TemporaryDirectory() as directory:
        return asyncio.run(endure(Path(directory), cycles))


def tables(quick: bool = False) -> list[Table]:
    """Memory and file."""
    cycles = 2_000 if quick else CYCLES
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as other:
        other.submit(endured, 50).result()  # else what the compiler leaves free here would hide what grows
    ran = endured(cycles)
    settled = ran.memory_mb[int(SETTLED * len(ran.memory_mb)) :]
    growth = max(settled) / settled[0] - 1.0
    seconds_kept = KEEP.days * 86_400.0
    return [
        Table(
            f"{cycles} cycles, one a second by their own time",
            ("what", "bar", "measured", "interval"),
            [
                (
                    f"memory after the first {SETTLED:.0%}",
                    "flat within 5 %",
                    f"{100 * growth:+.1f} %",
                    f"{min(settled):.0f} to {max(settled):.0f} MB",
                ),
                ("file", f"<= {KEEP.max_size_bytes / 2**20:.0f} MB", f"{ran.file_bytes / 2**20:.1f} MB", ""),
                ("processor time a cycle", "", f"{1e3 * ran.cpu_s:.1f} ms", "few samples each"),
                ("cycles kept", f"about {min(seconds_kept, cycles):.0f}", f"{ran.held}", ""),
            ],
            f"Peak of the process {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB.",
        )
    ]
