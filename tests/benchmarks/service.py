"""The whole service: cells on one core, delay from the module to OPC UA, and what a cycle costs.

`python -m tests.benchmarks.service CELLS ... [--seconds S]` prints the table of loads for so many cells.
"""

import argparse
import os
import sys
import tempfile
from pathlib import Path

import numpy as np

from tests.benchmarks._cycle_parts import parts
from tests.benchmarks._load import EVERY_CORE, OTHERS, PERIOD_S, PUBLISHING_MS, Load, cell_file, load
from tests.benchmarks.table import Table

ALONE = 4
"""Times as long for one cell, whose delays have a bar."""
SECONDS = 30.0
"""How long each number of cells is looked at, s."""
DELAY_BARS_MS = {1: 115.0, 24: 120.0, 48: 150.0}
"""Delay from a cycle's end to its notification, p99, that so many cells on one core may have at most."""
COLUMNS = ("what", "bar", "measured", "interval")


def loads(numbers: list[int], seconds: float) -> list[Load]:
    """Run so many cells on one core, one number after the other."""
    os.sched_setaffinity(0, OTHERS)
    runs: list[Load] = []
    for number in numbers:
        runs.append(load(number, ALONE * seconds if number == 1 else seconds))
        print("service:", " | ".join(runs[-1].row()), file=sys.stderr, flush=True)
    os.sched_setaffinity(0, EVERY_CORE)
    return runs


def load_tables(runs: list[Load], seconds: float) -> list[Table]:
    """Tables of loads and of the delays that have a bar."""
    without_loss = [run.cells for run in runs if not run.missed]
    delays = [
        (
            f"cycle complete to OPC UA notification, p99, {run.cells} cells",
            f"<= {DELAY_BARS_MS[run.cells]:.0f} ms, none missed",
            f"{np.percentile(run.delays_ms, 99):.0f} ms, {run.missed} missed",
            f"{len(run.delays_ms)} cycles",
        )
        for run in runs
        if run.cells in DELAY_BARS_MS and run.delays_ms
    ]
    return [
        Table(
            "Cells on one core, 2 cycles/s each with 20 000 force and 4 000 position samples",
            (
                "cells",
                "cells are",
                "CPU of the core",
                "CPU a cycle",
                "memory",
                "cycles",
                "start worked off in",
                "missed then",
                "cycle to notification p50 / p99",
                "load average",
            ),
            [run.row() for run in runs],
            f"The whole service at default settings: Modbus, prediction, tracking, alarms, journal, OPC UA "
            f"(a session signed and encrypted, publishing interval {PUBLISHING_MS} ms); modules and client "
            f"on the other core. {seconds:g} s each, one cell {ALONE} times as long, after what had waited "
            f"in the modules' rings was worked off. A cycle comes every {1e3 * PERIOD_S:g} ms and meets the "
            "publishing clock in all its phases.",
        ),
        Table(
            "The service",
            COLUMNS,
            [
                ("cells on one core with no cycle missed", ">= 48", f"{max(without_loss, default=0)}", ""),
                *delays,
            ],
        ),
    ]


def tables(quick: bool = False) -> list[Table]:
    """Cells on one core, the delay of their cycles, and what a cycle costs by part."""
    with tempfile.TemporaryDirectory() as directory:
        by_part = parts(cell_file(Path(directory), "cell", 1, 0, journal=True), 60 if quick else 240)
    seconds = SECONDS / 3 if quick else SECONDS
    runs = loads([1, 4] if quick else [1, 4, 8, 16, 24, 48], seconds)
    if not quick:
        os.sched_setaffinity(0, OTHERS)
        runs.append(load(24, seconds, commissioned=True))
        os.sched_setaffinity(0, EVERY_CORE)
    return [*load_tables(runs, seconds), by_part]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cells", type=int, nargs="+", help="numbers of cells, each run by itself")
    parser.add_argument(
        "--seconds", type=float, default=SECONDS, help="length of each, s (one cell four times)"
    )
    given = parser.parse_args()
    for table in load_tables(loads(given.cells, given.seconds), given.seconds):
        print(table.markdown())
