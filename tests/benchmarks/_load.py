"""One service with many cells: its load, and the delay from the module to OPC UA."""

import asyncio
import contextlib
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil
import yaml
from asyncua import Client, ua
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
from prometheus_client.parser import text_string_to_metric_families

from impactcell.opcua.certificates.making import make_certificate, own_hosts, write_pair
from impactcell.scada import Role
from impactcell.scada.users import User, with_password, write_users
from impactcell.tracking.wear_batch.settings import TrackerSettings
from tests.integration.processes import CONFIG, ROOT

PERIOD_S = 0.497  # two a second, and through all phases of the publishing clock
PUBLISHING_MS = 100
SETTLED_MS = 1000.0
"""The cycles that waited at the start are worked off once none in a second came later than this."""
LONGEST_START_S = 60.0
COMMISSIONED_S = 1.1 * TrackerSettings().commissioning_cycles * PERIOD_S
"""After this long every cell has learned its noise, for which some of its first cycles take 50 ms."""
EVERY_CORE = sorted(os.sched_getaffinity(0))
ITS_CORE, OTHERS = EVERY_CORE[:1], EVERY_CORE[1:] or EVERY_CORE
"""The service has one core of its own; modules and client have the others."""
USER, PASSWORD = "bench", "benchmark"
CLIENT_URI = "urn:test:client"


@dataclass(frozen=True)
class Load:
    """What one service did with so many cells.

    Attributes
    ----------
    cpu : float
        Of one core.
    missed_before, missed : int
        Cycles that the module had overwritten, before what waited at the start was worked off and since.
    settling_s : float
        From the first notification until what waited at the start was worked off; nan if it never was.
    waiting : float
        Programs that waited for a core meanwhile, this one's included (load average).
    """

    cells: int
    commissioned: bool
    cpu: float
    memory_mb: float
    received: int
    missed_before: int
    missed: int
    settling_s: float
    delays_ms: list[float]
    waiting: float

    @property
    def cpu_per_cycle_ms(self) -> float:
        """Processor time of the service for each cycle that comes, ms."""
        return 1e3 * self.cpu / (self.cells / PERIOD_S)

    def row(self) -> tuple[str, ...]:
        """Give its row of the table."""
        p50, p99 = (f"{np.percentile(self.delays_ms, q):.0f}" for q in (50, 99)) if self.delays_ms else "--"
        return (
            f"{self.cells}",
            "commissioned" if self.commissioned else "new",
            f"{100 * self.cpu:.0f} %",
            f"{self.cpu_per_cycle_ms:.1f} ms",
            f"{self.memory_mb:.0f} MB",
            f"{self.received}",
            f"{self.settling_s:.0f} s, {self.missed_before} missed",
            f"{self.missed}",
            f"{p50} / {p99} ms",
            f"{self.waiting:.1f}",
        )


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
        psutil.Process(process.pid).cpu_affinity(OTHERS)
        assert process.stdout is not None
        yield json.loads(process.stdout.readline())
    finally:
        process.terminate()
        process.communicate()


def cell_file(directory: Path, name: str, port: int, monitor: int, *, journal: bool) -> Path:
    """Write a cell with the settings that a cell has by itself."""
    cell = {
        "format": 1,
        "cell": name,
        "module": {"port": port, "register_map": str(CONFIG / "maps" / "fpga-v1.yaml")},
        "model": str(CONFIG / "models" / "prototype.yaml"),
        "alarms": {"wear_limit": 0.25},
        "opcua": {"endpoint": "opc.tcp://127.0.0.1:0/"},
        "web": {"endpoint": "http://127.0.0.1:0/"},
        "monitoring": {"port": monitor},
    }
    if journal:
        cell["journal"] = {"file": f"{name}.sqlite"}
    path = directory / f"{name}.yaml"
    path.write_text(yaml.safe_dump(cell))
    return path


@contextlib.contextmanager
def page_viewers(log: Path, cells: list[str]) -> Iterator[None]:
    """Streams of the page that is served by who writes `log`, read by a process of its own."""
    (endpoint,) = re.findall(r"page at (http\S+)", log.read_text())
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.benchmarks._page_viewers", endpoint, USER, PASSWORD, *cells],
        stdout=subprocess.PIPE,
        cwd=ROOT,
    )
    try:
        psutil.Process(process.pid).cpu_affinity(OTHERS)
        assert process.stdout is not None
        assert process.stdout.readline(), "the viewers ended"
        yield
        assert process.poll() is None, "the viewers ended"
    finally:
        process.kill()
        process.communicate()


@contextlib.contextmanager
def service(files: list[Path]) -> Iterator[tuple[psutil.Process, str, int]]:
    """The service on one core; its process, endpoint and monitoring port."""
    log = files[0].parent / "service.log"
    with log.open("w") as out:
        process = subprocess.Popen(
            ["taskset", "--cpu-list", str(ITS_CORE[0]), sys.executable, "-m", "impactcell", "run"]
            + [str(file) for file in files],
            stderr=out,
            cwd=ROOT,
        )
    try:
        seen = psutil.Process(process.pid)
        endpoint = _told(log, r" at (opc\.tcp://\S+)", process)
        monitor = int(_told(log, r"metrics at http://[^:]+:(\d+)", process))
        yield seen, endpoint, monitor
    finally:
        process.terminate()
        process.wait()


def _told(log: Path, pattern: str, process: subprocess.Popen[bytes]) -> str:
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


async def listen(
    endpoint: str,
    pair: tuple[Path, Path],
    cells: list[str],
    seconds: float,
    begun: Callable[[], None],
    *,
    commissioned: bool,
) -> tuple[float, list[float]]:
    """Seconds until settled, and then the delays from a cycle's end to its notification, ms, of all cells.

    The session is signed and encrypted with `pair`, certificate and key. `begun` is called when the delays
    begin to count.
    """
    delays: list[float] = []

    class Handler:
        def datachange_notification(self, _: object, __: object, data: object) -> None:
            value = data.monitored_item.Value  # type: ignore[attr-defined]
            if value.SourceTimestamp is not None and value.Value.Value:
                delays.append(1e3 * (time.time() - value.SourceTimestamp.timestamp()))

    client = Client(endpoint, timeout=60)
    client.set_user(USER)
    client.set_password(PASSWORD)
    client.application_uri = CLIENT_URI
    certificate, key = (str(file) for file in pair)
    await client.set_security(
        SecurityPolicyBasic256Sha256, certificate, key, mode=ua.MessageSecurityMode.SignAndEncrypt
    )
    async with client:
        index = await client.get_namespace_index("urn:impactcell:cells")
        subscription = await client.create_subscription(PUBLISHING_MS, Handler())
        nodes = [client.get_node(ua.NodeId(f"{cell}/Friction/CycleNumber", index)) for cell in cells]
        await subscription.subscribe_data_change(nodes, queuesize=100)
        started, settling_s = time.monotonic(), math.nan
        while math.isnan(settling_s) and time.monotonic() - started < LONGEST_START_S:
            delays.clear()
            await asyncio.sleep(1.0)
            if len(delays) >= len(cells) and max(delays) < SETTLED_MS:
                settling_s = time.monotonic() - started
        if commissioned:
            await asyncio.sleep(COMMISSIONED_S)
        begun()
        delays.clear()
        await asyncio.sleep(seconds)
        await subscription.delete()
    return settling_s, delays


def trusted_client(directory: Path) -> tuple[Path, Path]:
    """Make a client's certificate and key, and have the service's certificate folder trust it."""
    pair = write_pair(directory / "client", *make_certificate("bench", CLIENT_URI, own_hosts()))
    trusted = directory / "pki" / "trusted"
    trusted.mkdir(parents=True)
    (trusted / "bench.der").write_bytes(pair[0].read_bytes())
    return pair


def load(number: int, seconds: float, *, commissioned: bool = False, viewed: bool = False) -> Load:
    """Run so many cells for so long after they have settled, or after they have learned their noise.

    With `viewed`, many read the page meanwhile.
    """
    with tempfile.TemporaryDirectory() as temporary, modules(number, PERIOD_S) as ports:
        directory = Path(temporary)
        write_users(directory / "users.yaml", {USER: with_password(User(USER, Role.OBSERVER), PASSWORD)})
        pair = trusted_client(directory)
        names = [f"cell-{i}" for i in range(number)]
        files = [cell_file(directory, n, p, 0, journal=True) for n, p in zip(names, ports, strict=True)]
        with contextlib.ExitStack() as stack:
            process, endpoint, monitor = stack.enter_context(service(files))
            if viewed:
                stack.enter_context(page_viewers(directory / "service.log", names))
            at: list[tuple[float, float, dict[str, float]]] = []

            def look() -> None:
                spent = process.cpu_times()
                at.append((time.monotonic(), spent.user + spent.system, totals(monitor)))

            settling_s, delays = asyncio.run(
                listen(endpoint, pair, names, seconds, look, commissioned=commissioned)
            )
            look()
            memory = process.memory_info().rss
    (began, cpu, before), (ended, spent, after) = at
    return Load(
        number,
        commissioned,
        (spent - cpu) / (ended - began),
        memory / 2**20,
        int(after["impactcell_cycles_total"] - before["impactcell_cycles_total"]),
        int(before["impactcell_cycles_missed_total"]),
        int(after["impactcell_cycles_missed_total"] - before["impactcell_cycles_missed_total"]),
        settling_s,
        delays,
        os.getloadavg()[0],
    )
