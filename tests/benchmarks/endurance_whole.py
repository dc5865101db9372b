"""Cycles by the hundred thousand through simulator, Modbus, service, journal and OPC UA: memory and handles.

`python -m tests.benchmarks.endurance_whole [--cycles N] [--rate PER_SECOND]`. Simulator, service and an
encrypted subscriber are three processes; the simulator's clock runs faster than the one on the wall.
"""

import argparse
import asyncio
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import psutil
from asyncua import Client, ua
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256

from impactcell.scada import Role
from impactcell.scada.users import User, with_password, write_users
from tests.benchmarks._load import CLIENT_URI, PASSWORD, PUBLISHING_MS, totals, trusted_client
from tests.benchmarks.table import Table
from tests.integration.processes import simulator, started, write_cell
from tests.patience import COMPILING_S

CYCLES: Final = 100_000
RATE_HZ: Final = 20.0
"""Cycles a second that the simulator makes."""
SETTLED: Final = 0.1
"""Share of the cycles after which memory and handles count: by then the file has its size, all is learned."""
POINTS: Final = 50
"""How often, in equal numbers of cycles, the service is looked at."""
SILENT_S: Final = COMPILING_S
"""Without a new cycle for so long, no more will come, s."""
SENSORS: Final = {
    "force": {"rate_hz": 100_000, "noise_std": 0.4, "longest_s": 0.02},
    "position": {"rate_hz": 10_000, "noise_std": 1.5e-6, "longest_s": 0.2},
}
"""Fewer samples than a real module has: what grows grows with the cycles."""
FILE_MB: Final = 48.0
"""Size that the journal may have, so that it is full, and thinned, for most of the way."""


@dataclass(frozen=True)
class Moment:
    """How the service stood after so many cycles."""

    cycles: int
    memory_mb: float
    handles: int
    threads: int
    cpu_s: float


@dataclass(frozen=True)
class Endured:
    """What a run came to.

    Attributes
    ----------
    shown : list of int
        Numbers of the cycles that the subscriber was told of, as they came, their status Good.
    restated : int
        How often it was told that the last number is no longer Good: silence, or no communication.
    missed, missed_at_first : int
        Cycles that the module had overwritten before they were read, and how many when the first was shown.
    """

    moments: list[Moment]
    shown: list[int]
    restated: int
    missed: int
    missed_at_first: int
    file_mb: float
    seconds: float


class Subscriber:
    """Takes the numbers of cycles as they are notified."""

    def __init__(self) -> None:
        self.shown: list[int] = []
        self.restated = 0

    def datachange_notification(self, _: object, value: object, data: Any) -> None:
        """Take one value (called by asyncua); a status other than Good repeats the last one."""
        if not data.monitored_item.Value.StatusCode.is_good():
            self.restated += value != 0
        elif isinstance(value, int) and value:
            self.shown.append(value)


async def watch(process: psutil.Process, subscriber: Subscriber, cycles: int) -> list[Moment]:
    """Look at the service at points along the way, until the last cycle, or none for long."""
    moments: list[Moment] = []
    due, seen, seen_s = cycles // POINTS, 0, time.monotonic()
    while seen < cycles and time.monotonic() - seen_s < SILENT_S:
        await asyncio.sleep(0.2)
        newest = max(subscriber.shown, default=0)
        if newest != seen:
            seen, seen_s = newest, time.monotonic()
        if seen >= due:
            due = seen + cycles // POINTS
            with process.oneshot():
                spent = process.cpu_times()
                moment = Moment(
                    seen, process.memory_info().rss / 2**20, process.num_fds(), process.num_threads(),
                    spent.user + spent.system,
                )  # fmt: skip
            moments.append(moment)
            print(f"endurance: {moment}", file=sys.stderr, flush=True)
    return moments


async def endure(directory: Path, cycles: int, rate_hz: float) -> Endured:
    """Run so many cycles at so many a second."""
    write_users(directory / "users.yaml", {"bench": with_password(User("bench", Role.OBSERVER), PASSWORD)})
    certificate, key = (str(file) for file in trusted_client(directory))
    scenario = {
        "strikes": {"period_s": 1.0, "cycles": cycles, "order": "random"},
        "acceleration": rate_hz,
        "sensors": SENSORS,
        "wear": {"mu_s_per_1000_cycles": 5e-4},
        "batches": [{"from_cycle": 1, "id": "A"}],
        "deviations": [],
    }
    async with simulator(directory, **scenario) as module:
        cell = write_cell(
            directory,
            module["port"],
            opcua={"allow_sessions_without_encryption": False},
            journal={"max_size_mb": FILE_MB},
            monitoring={"port": 0},
        )
        async with started("impactcell", "run", str(cell)) as service:
            endpoint = (await service.line(r"cell=press-1 at (\S+)"))[1]
            monitor = int((await service.line(r"metrics at http://[^:]+:(\d+)"))[1])
            client = Client(endpoint, timeout=60)
            client.application_uri = CLIENT_URI
            client.set_user("bench")
            client.set_password(PASSWORD)
            await client.set_security(
                SecurityPolicyBasic256Sha256, certificate, key, mode=ua.MessageSecurityMode.SignAndEncrypt
            )
            async with client:
                subscriber = Subscriber()
                subscription = await client.create_subscription(PUBLISHING_MS, subscriber)
                index = await client.get_namespace_index("urn:impactcell:cells")
                node = client.get_node(ua.NodeId("press-1/Friction/CycleNumber", index))
                await subscription.subscribe_data_change([node], queuesize=1000)
                began_s = time.monotonic()
                assert isinstance(service.process, asyncio.subprocess.Process)
                while not subscriber.shown:
                    await asyncio.sleep(0.05)
                at_first = await _missed(monitor)
                moments = await watch(psutil.Process(service.process.pid), subscriber, cycles)
                seconds = time.monotonic() - began_s
                print("\n".join(service.lines), file=sys.stderr)
                missed = await _missed(monitor)
    shown, restated = subscriber.shown, subscriber.restated
    return Endured(moments, shown, restated, missed, at_first, journal_mb(directory), seconds)


async def _missed(monitor: int) -> int:
    return int((await asyncio.to_thread(totals, monitor))["impactcell_cycles_missed_total"])


def journal_mb(directory: Path) -> float:
    """Size of the journal with what is beside it."""
    return sum(file.stat().st_size for file in directory.glob("press-1.sqlite*")) / 2**20


def table(run: Endured, cycles: int, rate_hz: float) -> Table:
    """Table of one run."""
    settled = [moment for moment in run.moments if moment.cycles >= SETTLED * cycles]
    if not settled:
        shown = max(run.shown, default=0)
        raise RuntimeError(f"the service fell silent after cycle {shown} of {cycles}; what it said is above")
    first, last = settled[0], settled[-1]
    # The last fifth against the first, by their medians: one point may fall into a thinning of the journal.
    fifth = max(1, len(settled) // 5)
    memory = np.array([moment.memory_mb for moment in settled])
    growth = np.median(memory[-fifth:]) / np.median(memory[:fifth]) - 1.0
    cpu_s = (last.cpu_s - first.cpu_s) / max(1, last.cycles - first.cycles)
    numbers = np.array(run.shown)
    repeated = int(np.sum(np.diff(numbers) <= 0))
    skipped = int(numbers.max() - numbers.min() + 1 - len(np.unique(numbers)))
    rows = [
        (
            "memory, last fifth over first",
            "+ 2 %",
            f"{100 * growth:+.1f} %",
            f"{memory.min():.0f}-{memory.max():.0f} MB",
        ),
        ("handles", "+ 0", f"{last.handles - first.handles:+d}", f"{first.handles} at first"),
        ("threads", "", f"{last.threads - first.threads:+d}", f"{first.threads} at first"),
        (
            "cycles notified since the first",
            f"{cycles - run.shown[0] + 1}",
            f"{len(numbers)}",
            (f"{repeated} twice or out of order, {skipped} left out, {run.missed - run.missed_at_first} "
             f"overwritten meanwhile; {run.restated} times told to be old"),
        ),
        ("cycles overwritten in the module's ring", "0", f"{run.missed}", "the first while starting"),
        ("journal, with what is beside it", "", f"{run.file_mb:.1f} MB", f"may have {FILE_MB:g} MB"),
        ("processor time a cycle", "", f"{1e3 * cpu_s:.1f} ms", f"{run.seconds:.0f} s in all"),
    ]  # fmt: skip
    return Table(
        f"{cycles} cycles through simulator, Modbus, service, journal and OPC UA",
        ("what", "bar", "measured", "interval"),
        rows,
        f"{rate_hz:g} cycles a second, of 2 000 force samples and 2 000 positions at most; one encrypted "
        f"subscriber of the cycle number. Memory and handles after the first {SETTLED:.0%}.",
    )


def measured(cycles: int, rate_hz: float) -> Table:
    """Run so many cycles in a directory of its own."""
    with tempfile.TemporaryDirectory() as directory:
        return table(asyncio.run(endure(Path(directory), cycles, rate_hz)), cycles, rate_hz)


def tables(quick: bool = False) -> list[Table]:
    """Memory, handles and what was shown."""
    return [measured(2_000 if quick else CYCLES, RATE_HZ)]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cycles", type=int, default=CYCLES, help="how many")
    parser.add_argument("--rate", type=float, default=RATE_HZ, help="how many a second")
    given = parser.parse_args()
    print(measured(given.cycles, given.rate).markdown())
