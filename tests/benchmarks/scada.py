"""OPC UA: delay from write to notification for one client, fifty and a hundred, memory over lost ones.

`python -m tests.benchmarks.scada CLIENTS ... [--seconds S]` prints the row of so many clients alone.
"""

import argparse
import asyncio
import contextlib
import json
import subprocess
import sys
import tempfile
from asyncio.subprocess import PIPE
from collections.abc import AsyncIterator
from pathlib import Path

import numpy as np

from impactcell.scada import Role
from impactcell.scada.users import User, with_password, write_users
from tests.benchmarks._filter_cost import table as filter_costs
from tests.benchmarks._load import PASSWORD, trusted_client
from tests.benchmarks._opcua_clients import Listener, connected
from tests.benchmarks.table import Table
from tests.integration.processes import simulator, started, write_cell

ROOT = Path(__file__).resolve().parents[2]
COLUMNS = ("what", "bar", "measured", "interval")
PROCESSES = 2


@contextlib.asynccontextmanager
async def feed(rate_hz: float) -> AsyncIterator[tuple[dict, asyncio.subprocess.Process]]:
    """Start the publishing server."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "tests.benchmarks._opcua_feed", str(rate_hz), stdout=PIPE, cwd=ROOT
    )
    assert process.stdout is not None
    try:
        yield json.loads(await process.stdout.readline()), process
    finally:
        process.kill()
        await process.wait()


async def measure(
    site: dict, clients: int, items: int, interval_ms: float, seconds: float
) -> tuple[np.ndarray, float, np.ndarray]:
    """Delays of all values, seconds; values a second; lateness of a bare timer, seconds."""
    processes = min(PROCESSES, clients)
    shares = [clients // processes + (i < clients % processes) for i in range(processes)]
    started_ = []
    for share in shares:
        given = {
            "site": site,
            "clients": share,
            "items": items,
            "interval_ms": interval_ms,
            "seconds": seconds,
        }
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "tests.benchmarks._opcua_clients",
            json.dumps(given),
            stdin=PIPE,
            stdout=PIPE,
            stderr=subprocess.DEVNULL,
            cwd=ROOT,
            limit=2**26,
        )
        started_.append(process)
    for process in started_:
        assert process.stdout is not None
        assert await process.stdout.readline() == b"ready\n"
    for process in started_:
        assert process.stdin is not None
        process.stdin.write(b"\n")
        await process.stdin.drain()
    delays, late, rate = [], [], 0.0
    for process in started_:
        assert process.stdout is not None
        found = json.loads(await process.stdout.readline())
        delays.append(np.array(found["delays"]))
        late.append(np.array(found["late"]))
        rate += found["values"] / found["seconds"]
        await process.wait()
    return np.concatenate(delays), rate, np.concatenate(late)


def _ms(delays: np.ndarray) -> str:
    p50, p99 = np.percentile(delays, [50, 99]) * 1e3
    return f"p50 {p50:.1f} ms, p99 {p99:.1f} ms"


def _interval(delays: np.ndarray, late: np.ndarray) -> str:
    rng = np.random.default_rng(0)
    n = len(delays)
    found = [np.percentile(delays[rng.integers(0, n, n)], 99) * 1e3 for _ in range(200)]
    low, high = np.percentile(found, [2.5, 97.5])
    timer = np.percentile(late, 99) * 1e3
    return f"p99 in {low:.1f}-{high:.1f} ms, n = {n}; bare timer p99 {timer:.1f} ms late"


async def one_client(seconds: float) -> list[tuple[str, str, str, str]]:
    """Measure one client on a running cell: simulator and service with full captures at 2 cycles/s."""
    rows = []
    with tempfile.TemporaryDirectory() as temporary:
        directory = Path(temporary)
        write_users(directory / "users.yaml", {"eve": with_password(User("eve", Role.ENGINEER), PASSWORD)})
        certificate, key = (str(file) for file in trusted_client(directory))
        async with simulator(directory, strikes={"period_s": 0.5, "cycles": 1_000_000}) as module:
            path = write_cell(directory, module["port"])
            async with started("impactcell", "run", str(path)) as service:
                endpoint = (await service.line(r"cell=press-1 at (\S+)"))[1]
                site = {
                    "endpoint": endpoint,
                    "user": "eve",
                    "password": PASSWORD,
                    "certificate": certificate,
                    "key": key,
                }
                for interval_ms in (10.0, 50.0, 100.0):
                    delays, _, late = await measure(site, 1, 30, interval_ms, seconds)
                    rows.append(
                        (
                            f"write to notification, one client, P = {interval_ms:.0f} ms",
                            f"p99 <= {interval_ms + 15:.0f} ms",
                            _ms(delays),
                            _interval(delays, late),
                        )
                    )
    return rows


async def many_clients(clients: int, bar: str, seconds: float) -> tuple[str, str, str, str]:
    """Measure so many encrypted clients with 30 items each at 10 Hz."""
    async with feed(10.0) as (site, process):
        delays, rate, late = await measure(site, clients, 30, 100.0, seconds)
        assert process.stdout is not None
        what = f"{clients} clients x 30 items at 10 Hz, P = 100 ms, {rate:.0f} values/s of {300 * clients}"
        return what, bar, _ms(delays), _interval(delays, late)


async def memory(batches: int) -> tuple[str, str, str, str]:
    """Measure memory after batches of 100 clients that connect, subscribe and vanish."""
    after = []
    async with feed(10.0) as (site, process):
        assert process.stdout is not None
        for _ in range(batches):
            for _ in range(100):
                client = await connected({**site})
                listener = Listener(client, ["Friction/StaticFriction"], 100.0)
                await listener.start()
                # No goodbye: the socket is closed under the session.
                client.uaclient.protocol.transport.abort()
                await _forget(client)
            while (state := json.loads(await process.stdout.readline()))["sessions"] or state[
                "subscriptions"
            ]:
                pass
            after.append(state["rss"] / 2**20)
            sys.stderr.write(f"after {100 * len(after)} lost clients: {after[-1]:.1f} MB\n")
    warm = after[0]
    return (
        f"memory over {100 * batches} connect / subscribe / drop",
        "flat within 5 %",
        f"{after[-1] / warm - 1:+.1%} from the first 100 to the last",
        f"{min(after):.1f}-{max(after):.1f} MB after each 100",
    )


async def _forget(client: object) -> None:
    """End the tasks of a client whose connection is gone."""
    for task in asyncio.all_tasks():
        if task is not asyncio.current_task():
            task.cancel()
    await asyncio.sleep(0)


async def _rows(quick: bool) -> list[tuple[str, str, str, str]]:
    seconds = 10.0 if quick else 60.0
    rows = await one_client(seconds)
    rows.append(await many_clients(50, "p99 <= 105 ms", seconds))
    rows.append(await many_clients(100, "", seconds))
    rows.append(await memory(2 if quick else 10))
    return rows


def tables(quick: bool = False) -> list[Table]:
    """Measure everything."""
    rows = asyncio.run(_rows(quick))
    note = (
        "Delay: from the server timestamp of a value to the arrival of its notification in another process, "
        "by the clock of one machine. One client: simulator, service and client are three processes, cycles "
        "with full captures at 2 a second. Many clients: in two processes. All sessions signed and encrypted "
        "(Basic256Sha256). Interval: bootstrap over notifications; beside it how late a bare timer was."
    )
    return [Table("OPC UA", COLUMNS, rows, note), filter_costs()]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clients", type=int, nargs="+", help="numbers of clients, each run by itself")
    parser.add_argument("--seconds", type=float, default=60.0, help="length of each, s")
    given = parser.parse_args()
    print(
        Table(
            "OPC UA",
            COLUMNS,
            [asyncio.run(many_clients(number, "", given.seconds)) for number in given.clients],
            "",
        ).markdown()
    )
