"""The whole service: cells on one core, delay from the module to OPC UA, and what a cycle costs."""

import os
import sys
import tempfile
from pathlib import Path

import numpy as np

from tests.benchmarks._cycle_parts import parts
from tests.benchmarks._load import (
    EVERY_CORE,
    OTHERS,
    PERIOD_S,
    PUBLISHING_MS,
    SMALLER,
    WINDOW,
    Load,
    cell_file,
    load,
)
from tests.benchmarks.table import Table

ALONE = 4  # times as long for one cell, whose delays have a bar
COLUMNS = ("what", "bar", "measured", "interval")


def tables(quick: bool = False) -> list[Table]:
    """Cells on one core, the delay of one of them, and what its cycle costs by part."""
    numbers = (1, 4) if quick else (1, 4, 8, 16, 24)
    seconds = 10.0 if quick else 30.0
    with tempfile.TemporaryDirectory() as directory:
        by_part = parts(cell_file(Path(directory), "cell", 1, 0, journal=True), 60 if quick else 240)
    os.sched_setaffinity(0, OTHERS)
    loads: list[Load] = []

    def run(number: int, window: int = WINDOW, *, commissioned: bool = False) -> None:
        long = ALONE * seconds if number == 1 else seconds
        loads.append(load(number, long, window, commissioned=commissioned))
        print("service:", " | ".join(loads[-1].row()), file=sys.stderr, flush=True)

    for number in numbers:
        run(number)
    if not quick:
        run(numbers[-1], commissioned=True)
        run(1, SMALLER)
    os.sched_setaffinity(0, EVERY_CORE)
    without_loss = [n for n in numbers if not any(one.missed for one in loads if one.cells == n)]
    single = loads[0].delays_ms
    return [
        Table(
            "Cells on one core, 2 cycles/s each with 20 000 force and 4 000 position samples",
            (
                "cells",
                "window",
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
            [one.row() for one in loads],
            f"The whole service: Modbus, prediction, tracking, alarms, journal, OPC UA (publishing interval "
            f"{PUBLISHING_MS} ms); modules and client on the other core. {seconds:g} s each, one cell "
            f"{ALONE} times as long, after what had waited in the modules' rings was worked off. "
            f"A cycle comes every {1e3 * PERIOD_S:g} ms and meets the publishing clock in all its phases.",
        ),
        Table(
            "The service",
            COLUMNS,
            [
                ("cells on one core with no cycle missed", ">= 24", f"{max(without_loss, default=0)}", ""),
                (
                    "cycle complete to OPC UA notification, p99, one cell",
                    f"<= {PUBLISHING_MS} + 30 ms",
                    f"{np.percentile(single, 99):.0f} ms",
                    f"{len(single)} cycles",
                ),
            ],
        ),
        by_part,
    ]
