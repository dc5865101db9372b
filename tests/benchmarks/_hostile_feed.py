"""Process: 24 cells on one OPC UA server, two cycles a second each, with a past of 20 000 cycles."""

import asyncio
import gc
import json
import math
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import psutil

from impactcell.journal.store import Journal
from impactcell.opcua.sessions.large_requests import leave_full_rounds_to_the_server
from impactcell.service.history_source import JournalHistory
from tests.benchmarks._opcua_feed import cycle
from tests.opcua_server import PASSWORDS, START_NS, Site, site
from tests.snapshots import make_capture, make_snapshot

CELLS = tuple(f"press-{number}" for number in range(1, 25))
RATE_HZ = 2.0
"""Cycles a second of each cell."""
STORED = 20_000


def make_past(path: Path) -> None:
    """Store cycles half a second apart."""
    with Journal(path, CELLS[0]) as journal:
        journal._db.execute("PRAGMA synchronous = OFF")  # thrown away after the run
        made = replace(make_capture(1), force=None, position=None, actuator=None)
        for number in range(1, STORED + 1):
            capture = replace(made, cycle=number, time_ns=START_NS + number * 500_000_000)
            journal.append(capture, make_snapshot(capture, 0.2 + 1e-6 * number), b"", ())


class LoopWatch:
    """How long each step on the event loop took, in processor time: what else runs does not count.

    Counted in classes a hundredth wide instead of kept: millions of numbers, and their percentile, would hold
    the loop and the memory that are measured here.
    """

    SHORTEST_S, WIDTH, CLASSES = 1e-7, 0.01, 2000

    def __init__(self) -> None:
        self.counts = np.zeros(self.CLASSES, np.int64)
        self.longest_s = 0.0
        run = asyncio.events.Handle._run

        def watched(handle: asyncio.Handle) -> None:
            begin = time.thread_time()
            run(handle)
            held_s = time.thread_time() - begin
            self.longest_s = max(self.longest_s, held_s)
            self.counts[int(math.log(max(held_s / self.SHORTEST_S, 1.0)) / self.WIDTH)] += 1

        asyncio.events.Handle._run = watched  # type: ignore[method-assign]

    def told_ms(self) -> list[float]:
        """Give the 99.9th percentile, within a hundredth, and the longest; and begin anew."""
        reached = np.searchsorted(np.cumsum(self.counts), 0.999 * self.counts.sum())
        told = [1e3 * self.SHORTEST_S * math.exp(self.WIDTH * float(reached)), 1e3 * self.longest_s]
        self.counts[:], self.longest_s = 0, 0.0
        return told


class Cells:
    """What the cells do: work in a thread of each, then publish; and how late that was."""

    def __init__(self, here: Site) -> None:
        self.here = here
        self.late_s: list[float] = []
        self.watch = LoopWatch()
        self.published = self.due = self.lost = 0
        self.pending: dict[str, float] = {}
        self._threads = {cell: ThreadPoolExecutor(1) for cell in CELLS}

    async def run(self, cell: str, offset_s: float) -> None:
        """Publish a cycle each period; one that comes later than the next is due counts as lost."""
        loop, number = asyncio.get_running_loop(), 0
        begin = loop.time() + offset_s
        while True:
            number += 1
            due = begin + number / RATE_HZ
            await asyncio.sleep(max(0.0, due - loop.time()))
            self.due += 1
            self.pending[cell] = due
            snapshot = await loop.run_in_executor(self._threads[cell], cycle, number)
            self.here.server.publish(cell, snapshot)
            self.published += 1
            del self.pending[cell]
            late_s = loop.time() - due
            self.late_s.append(late_s)
            self.lost += late_s > 1.0 / RATE_HZ


async def tell(cells: Cells) -> None:
    """Tell a line whenever one is asked for: all since the one before."""
    loop, process = asyncio.get_running_loop(), psutil.Process()
    while await loop.run_in_executor(None, sys.stdin.readline):
        overdue = sum(loop.time() - due > 1.0 / RATE_HZ for due in cells.pending.values())
        late_ms = 1e3 * np.percentile(cells.late_s, [50, 99, 100]) if cells.late_s else np.full(3, np.nan)
        state: dict[str, Any] = {
            "due": cells.due,
            "lost": cells.lost + overdue,
            "late_ms": list(late_ms),
            "held_ms": cells.watch.told_ms(),
            "rss_mb": process.memory_info().rss / 2**20,
        }
        cells.due, cells.published, cells.lost = cells.due - cells.published, 0, 0
        cells.late_s.clear()
        sys.stdout.write(json.dumps(state) + "\n")
        sys.stdout.flush()


async def main() -> None:
    """Serve until stdin ends."""
    sys.setswitchinterval(0.001)  # as the service does
    with tempfile.TemporaryDirectory() as directory:
        past = Path(directory) / "past.sqlite"
        make_past(past)
        async with site(cells=CELLS) as here:
            journal = SimpleNamespace(file=past)
            settings = SimpleNamespace(cell=SimpleNamespace(settings=SimpleNamespace(journal=journal)))
            history = JournalHistory(dict.fromkeys(CELLS, settings))  # type: ignore[arg-type]
            here.history.values, here.history.alarms = history.values, history.alarms  # type: ignore[method-assign]
            for cell in CELLS:
                here.raise_alarm(cell=cell)
            gc.freeze()  # as the service does
            leave_full_rounds_to_the_server()
            cells = Cells(here)
            tasks = [
                asyncio.create_task(cells.run(cell, i / RATE_HZ / len(CELLS))) for i, cell in enumerate(CELLS)
            ]
            described = {
                "endpoint": here.server.endpoint,
                "certificate": str(here.certificate),
                "key": str(here.key),
                "passwords": PASSWORDS,
            }
            sys.stdout.write(json.dumps(described) + "\n")
            sys.stdout.flush()
            begun = time.monotonic()
            await tell(cells)
            for task in tasks:
                task.cancel()
            await history.close()
            sys.stderr.write(f"feed: {time.monotonic() - begun:.0f} s\n")


if __name__ == "__main__":
    asyncio.run(main())
