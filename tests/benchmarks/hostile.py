"""One hostile client of each role against an OPC UA server with 24 cells: cycles, other clients, memory."""

import asyncio
import json
import os
import subprocess
import sys
from asyncio.subprocess import PIPE, Process
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.benchmarks.scada import ROOT
from tests.benchmarks.table import Table

ROLES = ("nobody", "observer", "operator", "engineer")
SECONDS, QUICK_S, QUIET_S = 600.0, 6.0, 30.0
"""How long each hostile client has, in full and in short, and the longest time without one beside it."""
SETTLE_S = 15.0
"""After the hostile client is gone: sessions without a client have ended."""
COLUMNS = (
    "hostile client",
    "requests",
    "loop held, processor time",
    "cycles lost",
    "publishing late",
    "reads of another client",
    "memory",
)
LONGER_MS, MEMORY = 10.0, 0.05
"""Bars: how much longer another client's p99 may be, and how far memory may be from before."""


LONGEST_ANSWER = 2**24
"""Bytes of a line that a process says; a measuring client says every time."""


async def _process(module: str, *arguments: str) -> Process:
    return await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", f"tests.benchmarks.{module}", *arguments),
        stdin=PIPE,
        stdout=PIPE,
        stderr=subprocess.DEVNULL if module == "_hostile_feed" else None,
        cwd=ROOT,
        limit=LONGEST_ANSWER,
    )


async def _said(process: Process) -> Any:
    assert process.stdout is not None
    return json.loads(await process.stdout.readline())


async def _state(feed: Process) -> Any:
    assert feed.stdin is not None
    feed.stdin.write(b"\n")
    await feed.stdin.drain()
    return await _said(feed)


async def _client(site: dict[str, Any], role: str, seconds: float) -> Any:
    process = await _process("_hostile_clients", json.dumps({"site": site, "role": role, "seconds": seconds}))
    said = await _said(process)
    await process.wait()
    return said


async def _rows(seconds: float) -> list[tuple[str, ...]]:
    feed = await _process("_hostile_feed")
    site = await _said(feed)
    quiet_s = min(seconds, QUIET_S)
    await _client(site, "measure", quiet_s / 3)  # what is made once is made
    rows = []
    for role in ROLES:
        await _state(feed)
        first = await _client(site, "measure", quiet_s)
        before = await _state(feed)
        hostile, during = await asyncio.gather(
            _client(site, role, seconds), _client(site, "measure", seconds)
        )
        meanwhile = await _state(feed)
        await asyncio.sleep(SETTLE_S)
        after = await _state(feed)
        second = await _client(site, "measure", quiet_s)
        quiet = await _state(feed)
        alone = Alone([*first["ms"], *second["ms"]], before, quiet)
        rows.append(_row(role, hostile["asked"], alone, meanwhile, after, during))
        sys.stderr.write(" | ".join(rows[-1]) + "\n")
    feed.kill()
    await feed.wait()
    return rows


@dataclass(frozen=True)
class Alone:
    """Both stretches without the hostile client, before and after it: what the machine does by itself."""

    read_ms: list[float]
    before: Any
    after: Any

    @property
    def lost(self) -> tuple[int, int]:
        """Cycles that were lost, and that were due."""
        return self.before["lost"] + self.after["lost"], self.before["due"] + self.after["due"]

    @property
    def late_ms(self) -> float:
        """99th percentile of how late cycles were published, the worse of both."""
        return max(self.before["late_ms"][1], self.after["late_ms"][1])


def _row(role: str, asked: int, alone: Alone, meanwhile: Any, after: Any, during: Any) -> tuple[str, ...]:
    p99_alone, p99 = np.percentile(alone.read_ms, 99), np.percentile(during["ms"], 99)
    grown = after["rss_mb"] / alone.before["rss_mb"] - 1.0
    most, longest = meanwhile["held_ms"]
    quiet_most, quiet_longest = (
        max(pair) for pair in zip(alone.before["held_ms"], alone.after["held_ms"], strict=True)
    )
    held = f"p99.9 {quiet_most:.1f} to {most:.1f} ms, longest {quiet_longest:.1f} to {longest:.1f} ms"
    (quiet_lost, quiet_due), (lost, due) = (
        alone.lost,
        (meanwhile[number] + after[number] for number in ("lost", "due")),
    )
    cycles = f"{quiet_lost} of {quiet_due} to {lost} of {due}"
    longer = p99 - p99_alone
    reads = f"p99 {p99_alone:.1f} to {p99:.1f} ms ({longer:+.1f}; n = {len(during['ms'])})"
    memory = f"{alone.before['rss_mb']:.0f} to {after['rss_mb']:.0f} MB ({grown:+.1%})"
    return (
        role,
        str(asked),
        held if longest <= LONGER_MS else f"**{held}**",
        cycles if lost == 0 else f"**{cycles}**",
        f"p99 {alone.late_ms:.0f} to {meanwhile['late_ms'][1]:.0f} ms",
        reads if longer <= LONGER_MS else f"**{reads}**",
        memory if grown <= MEMORY else f"**{memory}**",
    )


def tables(quick: bool = False) -> list[Table]:
    """Measure."""
    seconds = QUICK_S if quick else SECONDS
    rows = asyncio.run(_rows(seconds))
    load = os.getloadavg()[2]
    note = (
        f"{seconds:.0f} s each, one after the other on one server; each is compared with as long a time "
        f"without it, {QUIET_S:.0f} s at most, before and after it in the same run. Bars: no step on the "
        f"loop longer than {LONGER_MS:.0f} ms of processor time; no cycle lost; another client's p99 at most "
        f"{LONGER_MS:.0f} ms longer; memory within {MEMORY:.0%} of before, {SETTLE_S:.0f} s later. 24 cells "
        "publish two cycles a second each, from a thread each and without module and estimators; a cycle "
        "counts as lost that is later than the next is due. The other client reads ten values fifty times "
        "a second, encrypted, from a process of its own; the hostile one has eight sessions in turn asking "
        "for all that its role may (without a login: 32 connections at a time), from another. Load of the "
        f"machine over the last 15 minutes: {load:.1f} on {os.cpu_count()} cores, other work included."
    )
    return [Table("One hostile client", COLUMNS, rows, note)]
