"""The service in this process, with what its cells have shown."""

import asyncio
import contextlib
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from pathlib import Path

from impactcell.records import Snapshot
from impactcell.service import Service
from impactcell.settings import read_cells
from tests.patience import COMPILING_S


@dataclass
class Watched:
    """A service in this process, with the snapshots of its cells."""

    service: Service
    snapshots: dict[str, list[Snapshot]] = field(default_factory=dict)
    news: asyncio.Condition = field(default_factory=asyncio.Condition)

    async def until(self, cell: str, cycles: int, timeout_s: float = COMPILING_S) -> list[Snapshot]:
        """Wait until a cell has shown so many cycles."""
        async with asyncio.timeout(timeout_s), self.news:
            await self.news.wait_for(lambda: len(self.snapshots.get(cell, [])) >= cycles)
        return self.snapshots[cell]

    async def connected(self, cell: str, timeout_s: float = COMPILING_S) -> None:
        """Wait until the module of a cell answers."""
        async with asyncio.timeout(timeout_s):
            while (task := self.service.running.get(cell)) is None or not task.status.connected:
                await asyncio.sleep(0.02)

    async def alarm(self, cell: str, name: str, *, active: bool, timeout_s: float = COMPILING_S) -> str:
        """Wait until an alarm is active, or not; its message."""
        async with asyncio.timeout(timeout_s):
            while True:
                alarm = next(a for a in self.service.running[cell].worker.alarms if a.name == name)
                if alarm.active is active:
                    return alarm.message
                async with self.news:
                    with contextlib.suppress(TimeoutError):
                        await asyncio.wait_for(self.news.wait(), 0.02)


@contextlib.asynccontextmanager
async def serving(*paths: Path) -> AsyncIterator[Watched]:
    """Run the service over cell files."""
    stop = asyncio.Event()
    tasks: set[asyncio.Task[None]] = set()

    def observe(cell: str, snapshot: Snapshot) -> None:
        watched.snapshots.setdefault(cell, []).append(snapshot)

        async def tell() -> None:
            async with watched.news:
                watched.news.notify_all()

        task = asyncio.create_task(tell())
        tasks.add(task)
        task.add_done_callback(tasks.discard)

    watched = Watched(Service(read_cells(paths), observe))
    started = asyncio.Event()
    running = asyncio.create_task(watched.service.run(stop, started.set))
    try:
        waiter = asyncio.create_task(started.wait())
        await asyncio.wait({running, waiter}, return_when=asyncio.FIRST_COMPLETED)
        waiter.cancel()
        yield watched
    finally:
        stop.set()
        await running
        if tasks:
            await asyncio.wait(tasks)
