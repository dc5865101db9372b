"""Process: a server with one cell that publishes a cycle in which every figure changes, at a fixed rate."""

import asyncio
import json
import sys
import time
from dataclasses import replace
from typing import Any

import numpy as np
import psutil

from impactcell.records import ModuleStatus, Snapshot
from impactcell.scada import ServerLimits
from tests.opcua_server import CELL, PASSWORDS, Site, site
from tests.snapshots import make_capture, make_snapshot

RATE_HZ = 10.0


def moved(value: Any, step: float) -> Any:
    """Change every number of a record a little, arrays and records inside it too."""
    if isinstance(value, np.ndarray):
        return value + step
    if isinstance(value, float):
        return step if value != value else value + step
    if hasattr(value, "__dataclass_fields__"):
        changes = {
            name: moved(getattr(value, name), step)
            for name in value.__dataclass_fields__
            if name != "limit" and not isinstance(getattr(value, name), (str, int, bool, tuple))
        }
        return replace(value, **changes)
    return value


def cycle(number: int) -> Snapshot:
    """Make a cycle that differs in every figure from the one before."""
    base = make_snapshot(make_capture(number))
    snapshot: Snapshot = moved(base, 1e-6 * number)
    batch = replace(snapshot.batch, last_shift_cycle=number)
    wear = replace(snapshot.wear, limit=0.3 + 1e-6 * number)
    return replace(snapshot, time_ns=time.time_ns(), batch=batch, wear=wear)


async def report(here: Site, lag: list[float]) -> None:
    """Tell once a second how the process is, for whoever waits for it to settle."""
    host = here.server._host
    assert host is not None
    process = psutil.Process()
    while True:
        await asyncio.sleep(1.0)
        state = {
            "sessions": len(host._sessions),
            "subscriptions": len(host.subscription_service),
            "rss": process.memory_info().rss,
            "cpu": sum(process.cpu_times()[:2]),
            "late_ms": 1e3 * max(lag, default=0.0),
        }
        lag.clear()
        sys.stdout.write(json.dumps(state) + "\n")
        sys.stdout.flush()


async def main(rate_hz: float) -> None:
    loop = asyncio.get_running_loop()
    lag: list[float] = []
    async with site(
        limits=ServerLimits(
            sessions=1000, connections=1000, sessions_per_user=1000, connections_per_address=1000
        )
    ) as here:
        site_of = {
            "endpoint": here.server.endpoint,
            "certificate": str(here.certificate),
            "key": str(here.key),
            "password": PASSWORDS["observer"],
        }
        sys.stdout.write(json.dumps(site_of) + "\n")
        sys.stdout.flush()
        task = loop.create_task(report(here, lag))
        number, due = 0, loop.time()
        while True:
            number += 1
            here.server.publish(CELL, cycle(number))
            state = ModuleStatus(connected=True, received=number, round_trip_s=1e-3 + 1e-9 * number)
            here.server.module(CELL, state, time.time_ns())
            due = max(due + 1.0 / rate_hz, loop.time() - 1.0)
            await asyncio.sleep(max(0.0, due - loop.time()))
            lag.append(loop.time() - due)
            if task.done():
                return


if __name__ == "__main__":
    asyncio.run(main(float(sys.argv[1]) if len(sys.argv) > 1 else RATE_HZ))
