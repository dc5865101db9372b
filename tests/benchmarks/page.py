"""The live page: what many viewers of many cells cost."""

import asyncio
import contextlib
import json
import sys
from asyncio.subprocess import PIPE
from collections.abc import AsyncIterator
from pathlib import Path
from urllib.parse import urlencode, urlsplit

import numpy as np

from tests.benchmarks.table import Table

ROOT = Path(__file__).resolve().parents[2]
CELLS, RATE_HZ = 24, 2.0
VIEWERS, IN_DEPTH = 20, 4
"""Open pages, and how many of them show one cell in depth, the others all cells."""
SETTLE_S = 8
"""Seconds after the last viewer has come that do not count: the usual taps have come by then."""


@contextlib.asynccontextmanager
async def page(rate_hz: float = RATE_HZ) -> AsyncIterator[tuple[str, asyncio.StreamReader]]:
    """Start the process with the page; each cell makes so many cycles a second."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "tests.benchmarks._page_feed", str(CELLS), str(rate_hz)),
        stdout=PIPE,
        cwd=ROOT,
    )
    assert process.stdout is not None
    try:
        yield json.loads(await process.stdout.readline())["endpoint"], process.stdout
    finally:
        process.kill()
        await process.wait()


class Viewer:
    """An open page, as far as the service sees it: logged in, and reading its stream."""

    def __init__(self, user: str = "olga", password: str = "x") -> None:
        self._form = urlencode({"user": user, "password": password}).encode()
        self.received = 0
        self.cards = 0

    async def run(self, endpoint: str, path: str) -> None:
        """Read until cancelled."""
        host, port = urlsplit(endpoint).hostname, urlsplit(endpoint).port
        reader, writer = await asyncio.open_connection(host, port)
        form = self._form
        kind = "application/x-www-form-urlencoded"
        head = (
            f"POST /login HTTP/1.1\r\nHost: h\r\nContent-Type: {kind}\r\nContent-Length: {len(form)}\r\n\r\n"
        )
        writer.write(head.encode() + form)
        answer = (await reader.readuntil(b"\r\n\r\n")).decode()
        cookie = next(v for k, _, v in map(str.partition, answer.splitlines(), ":" * 99) if k == "set-cookie")
        cookie = cookie.partition(";")[0].strip()
        writer.write(f"GET {path} HTTP/1.1\r\nHost: h\r\nCookie: {cookie}\r\n\r\n".encode())
        try:
            while data := await reader.read(1 << 16):
                self.received += len(data)
                self.cards += data.count(b"event: card")
        finally:
            writer.close()


async def viewed(seconds: int) -> tuple[np.ndarray, float, float, float]:
    """Measure the page's thread: its share of a core each second; cycles/s, kB/s, cards/s of a viewer."""
    async with page() as (endpoint, reports):
        viewers = [Viewer() for _ in range(VIEWERS)]
        paths = [f"/live?cell=press-{i + 1}" if i < IN_DEPTH else "/live" for i in range(VIEWERS)]
        tasks = [asyncio.create_task(v.run(endpoint, p)) for v, p in zip(viewers, paths, strict=True)]
        for _ in range(SETTLE_S):
            await reports.readline()
        before = [(v.received, v.cards) for v in viewers]
        shares = []
        for _ in range(seconds):
            report = json.loads(await reports.readline())
            shares.append(report["page"])
        overview = range(IN_DEPTH, VIEWERS)
        received = np.mean([viewers[i].received - before[i][0] for i in overview])
        cards = np.mean([viewers[i].cards - before[i][1] for i in overview])
        for task in tasks:
            task.cancel()
        outcomes = await asyncio.gather(*tasks, return_exceptions=True)
        failed = [o for o in outcomes if not isinstance(o, asyncio.CancelledError)]
        assert not failed, failed
        return np.array(shares), report["rate"], float(received) / seconds / 1e3, float(cards) / seconds


def tables(*, quick: bool = False) -> list[Table]:
    """Every table of this topic."""
    shares, rate, kilobytes, cards = asyncio.run(viewed(10 if quick else 40))
    rng = np.random.default_rng(0)
    means = [rng.choice(shares, len(shares)).mean() for _ in range(1000)]
    low, high = np.percentile(means, [2.5, 97.5])
    mean = float(shares.mean())
    text = f"{mean:.1%} of a core"
    rows = [
        (
            f"{CELLS} cells at {rate:.1f} cycles/s, {VIEWERS} viewers, {IN_DEPTH} of them of one cell",
            "5 % of a core",
            text if mean <= 0.05 else f"**{text}**",
            f"{low:.1%}-{high:.1%}, n = {len(shares)} s; to each: {kilobytes:.0f} kB/s, {cards:.0f} cards/s",
        )
    ]
    note = (
        "CPU time of the page's own thread, by the system's count; captures of 2 x 4000 samples; viewers are "
        "streams that a second process reads. Left out: the browsers' own work, trends, and what the service "
        "does before it hands a cycle over."
    )
    return [Table("The page", ("what", "bar", "measured", "95 % interval"), rows, note)]
