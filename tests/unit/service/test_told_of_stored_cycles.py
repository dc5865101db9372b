"""A module is told what is stored whenever that comes: one that waits for it would stand still."""

import asyncio
import contextlib
import sqlite3
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from impactcell.cell import StepResult
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.transports import transport_for
from impactcell.records import CycleId
from impactcell.service.cell_task import CellTask
from impactcell.settings import CellConfig, read_cell
from impactcell.settings.sections import JournalSection
from simulator.modbus_server import ModbusServer
from simulator.scripted import ScriptedDevice
from tests.integration.processes import CONFIG
from tests.patience import PATIENCE_S
from tests.snapshots import make_snapshot
from tests.unit.fieldbus.test_acquisition import make


@pytest.fixture
def cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> CellConfig:
    """A cell with a journal, in which nothing is estimated."""

    def step(*given: Any, **_more: Any) -> StepResult:
        _log, _design, state, capture, *_ = given
        return StepResult(state, make_snapshot(capture, 0.2), (), ())

    async def at_once(_worker: object) -> None: ...

    monkeypatch.setattr("impactcell.service.worker.guarded_step", step)
    monkeypatch.setattr("impactcell.service.worker.CellWorker.warm_up", at_once)
    monkeypatch.setattr("impactcell.service.cell_task.TICK_S", 0.01)
    read = read_cell(CONFIG / "cells" / "prototype.yaml")
    changed = {"journal": JournalSection(file=tmp_path / "j"), "positioning": None}
    return replace(read, settings=read.settings.model_copy(update=changed))


@contextlib.asynccontextmanager
async def running(
    cell: CellConfig, device: ScriptedDevice, shown: list[int]
) -> AsyncIterator[tuple[ModbusServer, CellTask]]:
    """Run the cycles and the clock of a cell; `shown` gets the cycles of which all is through."""
    async with ModbusServer(device) as server:
        link = ModuleLink(port=server.port, timeout_s=PATIENCE_S)
        task = CellTask(cell, lambda _cell, snapshot: shown.append(snapshot.cycle), transport_for(link))
        work = [asyncio.ensure_future(work) for work in (task._acquire(), task._tick())]
        try:
            yield server, task
        finally:
            for each in work:
                each.cancel()
            await asyncio.gather(*work, return_exceptions=True)
            await task._module.close()
            await task.close()


async def until(holds: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE_S):
        while not holds():
            await asyncio.sleep(0.01)


@contextlib.contextmanager
def held(cell: CellConfig) -> Iterator[None]:
    """Hold a cell's journal, as another program may."""
    assert cell.settings.journal is not None
    with contextlib.closing(sqlite3.connect(cell.settings.journal.file, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        yield
        other.execute("ROLLBACK")


async def test_what_had_to_wait_for_the_journal(cell: CellConfig) -> None:
    """No other cycle came after them, and they were never acknowledged."""
    device = ScriptedDevice(cell.register_map, session=3)
    async with running(cell, device, shown := []):
        with held(cell):
            make(device, 2)
            await until(lambda: shown == [1, 2])
            assert device.acknowledged == []
        await until(lambda: device.acknowledged == [(3, 2)])


async def test_what_was_stored_during_an_outage(cell: CellConfig) -> None:
    device = ScriptedDevice(cell.register_map, session=3)
    async with running(cell, device, shown := []) as (server, task):
        with held(cell):
            make(device, 2)
            await until(lambda: shown == [1, 2])
            await server.close()
            await until(lambda: not task.status.connected)
        await until(lambda: task.worker.durable == CycleId(3, 2))
        assert device.acknowledged == []
        await server.start()
        await until(lambda: device.acknowledged == [(3, 2)])


@pytest.mark.parametrize("anew", [False, True], ids=["the same life", "started anew meanwhile"])
async def test_what_was_stored_before_the_service_started_anew(cell: CellConfig, *, anew: bool) -> None:
    """The service had ended between storing and telling; of a life before, the module is told nothing."""
    device = ScriptedDevice(cell.register_map, session=3)
    make(device, 2)
    async with running(cell, device, []):
        await until(lambda: device.acknowledged[-1:] == [(3, 2)])
    device.acknowledged.clear()
    if anew:
        device.start(session=4)
    async with running(cell, device, []) as (_, task):
        await until(lambda: task.status.connected)
        assert device.acknowledged == ([] if anew else [(3, 2)])
