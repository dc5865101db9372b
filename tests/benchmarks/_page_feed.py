"""Process: the page of many cells that publish cycles with full captures; tells what its thread has cost."""

import asyncio
import json
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import psutil

from impactcell.records import ModuleStatus
from impactcell.scada import Actor, ConditionAction, Role
from impactcell.scada.users import User, write_users
from impactcell.web import CellFacts, CellNews, PageServer, PageSettings
from impactcell.web.interface import Freshness
from tests.benchmarks._opcua_feed import moved
from tests.snapshots import make_capture, make_snapshot

SAMPLES = 4000
"""Of each channel of a capture."""
PREPARED = 40
"""Different cycles, made beforehand: what is measured is the page, not this process."""


class Backend:
    """Lets everybody in."""

    async def log_in(self, name: str, password: str, address: str) -> Actor:
        return Actor(name, Role.OBSERVER, address)

    async def act_on_condition(self, cell: str, alarm: str, action: ConditionAction, actor: Actor) -> None:
        raise NotImplementedError

    async def trust_certificate(self, thumbprint: str, actor: Actor) -> None:
        raise NotImplementedError

    async def accept_model(self, cell: str, extended: Path, actor: Actor) -> str:
        raise NotImplementedError

    async def restore_model(self, cell: str, actor: Actor) -> str:
        raise NotImplementedError


def cpu_s(thread: int) -> float:
    """Time that a thread of this process has spent computing, for itself and in the system."""
    return sum(t.user_time + t.system_time for t in psutil.Process().threads() if t.id == thread)


async def publish(server: PageServer, names: list[str], rate_hz: float) -> None:
    """Publish a cycle of every cell at a rate, the cells evenly after each other; reports once a second."""
    captures = [make_capture(i, samples=SAMPLES) for i in range(PREPARED)]
    snapshots = [moved(make_snapshot(capture), 1e-6 * i) for i, capture in enumerate(captures)]
    alarms = snapshots[0].alarms  # none of them moves, as in nearly every cycle
    page, main = server._thread.native_id or 0, psutil.Process().threads()[0].id
    loop = asyncio.get_running_loop()
    began, told, sent = loop.time(), loop.time(), 0
    costs = {thread: cpu_s(thread) for thread in (page, main)}
    while True:
        cell, number = names[sent % len(names)], 1 + sent // len(names)
        capture, snapshot = captures[number % PREPARED], snapshots[number % PREPARED]
        snapshot = replace(snapshot, cycle=number, time_ns=time.time_ns(), alarms=alarms)
        status = ModuleStatus(connected=True, received=number, round_trip_s=1e-3 + 1e-9 * number)
        server.feed.put(CellNews(cell, status=status))
        server.feed.put(CellNews(cell, snapshot, capture, freshness=Freshness.LIVE))
        sent += 1
        if loop.time() - told > 1.0:
            now = {thread: cpu_s(thread) for thread in (page, main)}
            share = {t: (now[t] - costs[t]) / (loop.time() - told) for t in costs}
            state = {"page": share[page], "rate": sent / (loop.time() - began) / len(names)}
            sys.stdout.write(json.dumps(state | {"rss": psutil.Process().memory_info().rss}) + "\n")
            sys.stdout.flush()
            told, costs = loop.time(), now
        await asyncio.sleep(max(0.0, began + sent / (rate_hz * len(names)) - loop.time()))


def main(cells: int, rate_hz: float) -> None:
    names = [f"press-{i + 1}" for i in range(cells)]
    with tempfile.TemporaryDirectory() as directory:
        users = Path(directory) / "users.yaml"
        write_users(users, {"olga": User("olga", Role.OBSERVER, password="x")})
        settings = PageSettings("http://127.0.0.1:0", users, Path(directory), Path(directory) / "studies")
        server = PageServer(settings, [CellFacts(name, "", "") for name in names], Backend())
        server.start()
        sys.stdout.write(json.dumps({"endpoint": server.endpoint}) + "\n")
        sys.stdout.flush()
        asyncio.run(publish(server, names, rate_hz))


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]))
