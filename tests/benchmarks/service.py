"""The whole service: cells on one core, delay from the module to OPC UA, memory and file over many cycles."""

import asyncio
import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil
import yaml
from asyncua import Client, ua
from prometheus_client.parser import text_string_to_metric_families

from impactcell.scada import Role
from impactcell.scada.users import User, with_password, write_users
from tests.benchmarks.table import Table
from tests.integration.processes import CONFIG, ROOT

PERIOD_S = 0.5
PUBLISHING_MS = 100
PASSWORD = "benchmark"
COLUMNS = ("what", "bar", "measured", "interval")


@dataclass(frozen=True)
class Load:
    """What one service did with so many cells."""

    cells: int
    cpu: float
    memory_mb: float
    received: int
    missed: int
    delays_ms: list[float]


@contextlib.contextmanager
def modules(number: int, period_s: float) -> Iterator[list[int]]:
    """Modules in a process of their own, kept from the service's core."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.benchmarks._modules", str(number), str(period_s)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd=ROOT,
    )
    try:
        psutil.Process(process.pid).cpu_affinity(cores()[1:])
        assert process.stdout is not None
        yield json.loads(process.stdout.readline())
    finally:
        process.terminate()
        process.communicate()


def cores() -> list[int]:
    """First the service's core, then those of everything else."""
    every = sorted(os.sched_getaffinity(0))
    return [every[0], *(every[1:] or every)]


def cell_file(directory: Path, name: str, port: int, monitor: int, *, journal: bool) -> Path:
    cell = {
        "format": 1,
        "cell": name,
        "module": {"port": port, "register_map": str(CONFIG / "maps" / "fpga-v1.yaml"), "window": 16},
        "model": str(CONFIG / "models" / "prototype.yaml"),
        "alarms": {"wear_limit": 0.25},
        "opcua": {"endpoint": "opc.tcp://127.0.0.1:0/", "allow_sessions_without_encryption": True},
        "monitoring": {"port": monitor},
    }
    if journal:
        cell["journal"] = {"file": f"{name}.sqlite"}
    path = directory / f"{name}.yaml"
    path.write_text(yaml.safe_dump(cell))
    return path


@contextlib.contextmanager
def service(files: list[Path]) -> Iterator[tuple[psutil.Process, str, int]]:
    """The service on one core; its process, endpoint and monitoring port."""
    log = files[0].parent / "service.log"
    with log.open("w") as out:
        process = subprocess.Popen(
            [sys.executable, "-m", "impactcell", "run", *map(str, files)], stderr=out, cwd=ROOT
        )
    try:
        seen = psutil.Process(process.pid)
        seen.cpu_affinity(cores()[:1])
        endpoint = _told(log, r" at (opc\.tcp://\S+)", process)
        monitor = int(_told(log, r"metrics at http://[^:]+:(\d+)", process))
        yield seen, endpoint, monitor
    finally:
        process.terminate()
        process.wait()


def _told(log: Path, pattern: str, process: subprocess.Popen[bytes]) -> str:
    import re

    deadline = time.monotonic() + 120.0
    while time.monotonic() < deadline and process.poll() is None:
        match = re.search(pattern, log.read_text())
        if match:
            return match[1]
        time.sleep(0.05)
    raise RuntimeError(f"the service did not start:\n{log.read_text()}")


def totals(monitor: int) -> dict[str, float]:
    """Sums of the service's counters over its cells."""
    with urllib.request.urlopen(f"http://127.0.0.1:{monitor}/metrics", timeout=10) as answer:
        text = answer.read().decode()
    return {
        sample.name: sum(one.value for one in family.samples if one.name == sample.name)
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


async def listen(endpoint: str, cells: list[str], seconds: float) -> list[float]:
    """Delays from the end of a cycle to its notification, ms, of all cells together."""
    delays: list[float] = []

    class Handler:
        def datachange_notification(self, _: object, __: object, data: object) -> None:
            value = data.monitored_item.Value  # type: ignore[attr-defined]
            if value.SourceTimestamp is not None and value.Value.Value:
                delays.append(1e3 * (time.time() - value.SourceTimestamp.timestamp()))

    client = Client(endpoint, timeout=60)
    client.set_user("bench")
    client.set_password(PASSWORD)
    async with client:
        index = await client.get_namespace_index("urn:impactcell:cells")
        subscription = await client.create_subscription(PUBLISHING_MS, Handler())
        nodes = [client.get_node(ua.NodeId(f"{cell}/Friction/CycleNumber", index)) for cell in cells]
        await subscription.subscribe_data_change(nodes, queuesize=100)
        await asyncio.sleep(1.0)
        delays.clear()
        await asyncio.sleep(seconds)
        await subscription.delete()
    return delays


def load(number: int, seconds: float) -> Load:
    """Run so many cells for so long after they have settled."""
    with tempfile.TemporaryDirectory() as temporary, modules(number, PERIOD_S) as ports:
        directory = Path(temporary)
        write_users(
            directory / "users.yaml", {"bench": with_password(User("bench", Role.OBSERVER), PASSWORD)}
        )
        names = [f"cell-{i}" for i in range(number)]
        files = [cell_file(directory, n, p, 0, journal=True) for n, p in zip(names, ports, strict=True)]
        with service(files) as (process, endpoint, monitor):
            deadline = time.monotonic() + 120.0
            while (
                totals(monitor).get("impactcell_cycles_total", 0) < 4 * number and time.monotonic() < deadline
            ):
                time.sleep(0.2)
            time.sleep(5.0)
            before, started, cpu = totals(monitor), time.monotonic(), process.cpu_times()
            delays = asyncio.run(listen(endpoint, names, seconds))
            elapsed, spent, after = time.monotonic() - started, process.cpu_times(), totals(monitor)
            used = spent.user + spent.system - cpu.user - cpu.system
            memory = process.memory_info().rss
    return Load(
        number,
        used / elapsed,
        memory / 2**20,
        int(after["impactcell_cycles_total"] - before["impactcell_cycles_total"]),
        int(after["impactcell_cycles_missed_total"] - before["impactcell_cycles_missed_total"]),
        delays,
    )


def tables(quick: bool = False) -> list[Table]:
    """Cells on one core, and the delay of one of them."""
    numbers = (1, 4) if quick else (1, 4, 8, 16, 24)
    seconds = 10.0 if quick else 30.0
    loads = [load(number, seconds) for number in numbers]
    rows = [
        (
            f"{one.cells}",
            f"{100 * one.cpu:.0f} %",
            f"{one.memory_mb:.0f} MB",
            f"{one.received}",
            f"{one.missed}",
            f"{np.percentile(one.delays_ms, 50):.0f} / {np.percentile(one.delays_ms, 99):.0f} ms",
        )
        for one in loads
    ]
    most = max((one for one in loads if one.missed == 0), key=lambda one: one.cells, default=None)
    single = loads[0].delays_ms
    return [
        Table(
            "Cells on one core, 2 cycles/s each with 20 000 force and 4 000 position samples",
            ("cells", "CPU of the core", "memory", "cycles", "missed", "cycle to notification p50 / p99"),
            rows,
            f"The whole service: Modbus, prediction, tracking, alarms, journal, OPC UA (publishing interval "
            f"{PUBLISHING_MS} ms); modules and client on the other core. {seconds:g} s each.",
        ),
        Table(
            "The service",
            COLUMNS,
            [
                ("cells on one core with no cycle missed", ">= 24", f"{most.cells if most else 0}", ""),
                (
                    "cycle complete to OPC UA notification, p99, one cell",
                    f"<= {PUBLISHING_MS} + 30 ms",
                    f"{np.percentile(single, 99):.0f} ms",
                    f"{len(single)} cycles",
                ),
            ],
        ),
    ]
