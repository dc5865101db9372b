"""The live page in a browser: how fast it opens, and its memory over half a day.

`IMPACTCELL_PAGE_HOURS=12` says how long the screen shows the cells, in hours of the cells' time;
`IMPACTCELL_PAGE_SPEED=10` how much faster than real the cells run.
"""

import asyncio
import json
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.benchmarks.page import CELLS, RATE_HZ, page
from tests.benchmarks.table import Table
from tests.browser.chromium import DESK, Browser, chromium

OPENED = {
    "cells": "/",
    "cell": "/cells/press-1",
    "alarms": "/alarms",
    "studies": "/studies",
    "system": "/system",
}
OPENING_BAR_S, BYTES_BAR = 0.5, 200_000
"""What is asked of a page with all that belongs to it, with an empty cache."""
FLAT = 0.05
"""Growth of memory that is called flat, as a share."""
SAMPLES = 40
"""Looks at the memory over the whole time."""
WARM_SHARE = 0.25
"""Of the time, the first part, in which what is remembered of a cell fills up; it does not count."""
COLUMNS = ("what", "bar", "measured", "interval")


@dataclass(frozen=True, slots=True)
class Memory:
    """Memory at one moment, MiB: resident of the server's process, JavaScript's heap after a collection."""

    server: float
    browser: float


def log_in(browser: Browser, endpoint: str) -> None:
    browser.show_as("light", DESK)
    browser.open(endpoint)
    browser.log_in("olga", "x")
    browser.until(lambda: browser.path == "/", "the cells")


def opened(browser: Browser, endpoint: str, path: str) -> tuple[float, int, set[str]]:
    """Open a page with an empty cache: seconds until all is loaded, bytes, hosts asked."""
    browser.driver.execute_cdp_cmd("Network.clearBrowserCache", {})
    browser.open("about:blank")
    browser.traffic()
    browser.open(endpoint + path)
    timing = "return performance.getEntriesByType('navigation')[0].loadEventEnd"
    took_ms = browser.until(lambda: browser.run(timing), "the end of loading")
    hosts, length = browser.traffic()
    return 1e-3 * took_ms, length, hosts


def heap_mib(browser: Browser) -> float:
    browser.traffic()  # what the driver has written down of the stream does not pile up
    browser.driver.execute_cdp_cmd("HeapProfiler.collectGarbage", {})
    return float(browser.driver.execute_cdp_cmd("Runtime.getHeapUsage", {})["usedSize"]) / 2**20


async def opening(times: int) -> list[tuple[str, str, str, str]]:
    """Open every page of cells that run, each so many times."""
    rows = []
    async with page() as (endpoint, reports):
        draining = asyncio.create_task(_drain(reports))
        with tempfile.TemporaryDirectory() as profile, chromium(Path(profile)) as browser:
            await asyncio.to_thread(log_in, browser, endpoint)
            for name, path in OPENED.items():
                seen = [await asyncio.to_thread(opened, browser, endpoint, path) for _ in range(times)]
                took = np.array([item[0] for item in seen])
                length = max(item[1] for item in seen)
                outside = set().union(*(item[2] for item in seen)) - {endpoint.removeprefix("http://")}
                text = f"{np.median(took):.2f} s, {length / 1e3:.0f} kB, {len(outside)} outside"
                met = np.median(took) <= OPENING_BAR_S and length <= BYTES_BAR and not outside
                range_s = f"{took.min():.2f}-{took.max():.2f} s, n = {times}"
                bar = f"{OPENING_BAR_S} s, {BYTES_BAR // 1000} kB, 0 outside"
                rows.append((f"{name}, cold, loopback", bar, text if met else f"**{text}**", range_s))
        draining.cancel()
    return rows


async def _drain(reports: asyncio.StreamReader) -> None:
    while await reports.readline():
        pass


async def remembered(hours: float, speed: float) -> tuple[list[Memory], float]:
    """Show a cell in depth for so long; memory at every look, and the cycles a second that each cell made."""
    step_s = hours * 3600 / speed / SAMPLES
    looks: list[Memory] = []
    rate = 0.0
    async with page(RATE_HZ * speed) as (endpoint, reports):
        with tempfile.TemporaryDirectory() as profile, chromium(Path(profile)) as browser:
            await asyncio.to_thread(log_in, browser, endpoint)
            await asyncio.to_thread(browser.open, f"{endpoint}/cells/press-1")
            loop = asyncio.get_running_loop()
            due = loop.time() + step_s
            while len(looks) < SAMPLES:
                report = json.loads(await reports.readline())
                rate = report["rate"]
                if loop.time() >= due:
                    heap = await asyncio.to_thread(heap_mib, browser)
                    looks.append(Memory(report["rss"] / 2**20, heap))
                    due += step_s
    return looks, rate


def growth(values: np.ndarray) -> tuple[float, float]:
    """Growth of a straight line over the time that counts, as a share of its mean; its standard deviation."""
    counted = values[int(WARM_SHARE * len(values)) :]
    x = np.linspace(-0.5, 0.5, len(counted))
    slope = x @ (counted - counted.mean()) / (x @ x)
    residual = counted - counted.mean() - slope * x
    std = np.sqrt(residual @ residual / (len(x) - 2) / (x @ x))
    return float(slope / counted.mean()), float(std / counted.mean())


def tables(*, quick: bool = False) -> list[Table]:
    """Every table of this topic."""
    rows = asyncio.run(opening(3 if quick else 20))
    hours = float(os.environ.get("IMPACTCELL_PAGE_HOURS", "0.25" if quick else "12"))
    speed = float(os.environ.get("IMPACTCELL_PAGE_SPEED", "10"))
    looks, rate = asyncio.run(remembered(hours, speed))
    for name in ("server", "browser"):
        values = np.array([getattr(look, name) for look in looks])
        share, std = growth(values)
        interval = f"{share - 2 * std:+.1%} to {share + 2 * std:+.1%}"
        text = f"{share:+.1%}, at the end {values[-1]:.0f} MiB"
        rows.append(
            (
                f"memory of the {name}, {hours:g} h of {CELLS} cells at {RATE_HZ:g} cycles/s",
                f"flat within {FLAT:.0%}",
                text if share <= FLAT else f"**{text}**",
                f"{interval}, n = {len(looks)}; {rate:.1f} cycles/s made",
            )
        )
    note = (
        "Chromium without a window; until the end of the load event. Memory: a cell's page open all along, "
        f"{speed:g} times faster than real, a straight line after the first {WARM_SHARE:.0%}; the JavaScript "
        "heap after a collection. Left out: what the service does before it hands a cycle over."
    )
    return [Table("The page in a browser", COLUMNS, rows, note)]
