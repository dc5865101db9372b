"""A PLC that takes a part away before the outcome of its last tap has been read."""

import asyncio
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio

from impactcell.fieldbus.acquisition import ModuleAcquisition, ModuleStatus
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.status_block import PositioningStatus, StatusBlock
from impactcell.fieldbus.transports import transport_for
from impactcell.journal.retention import Retention
from impactcell.journal.store import Journal
from impactcell.service.factory import cell_design, module_link
from impactcell.service.positioning import PositioningTask
from impactcell.service.worker import CellWorker
from impactcell.settings import CellConfig, read_cell
from tests.integration.processes import CONFIG


@pytest.fixture(scope="module")
def cell() -> CellConfig:
    return read_cell(CONFIG / "cells" / "positioning.yaml")


def block(**changed: Any) -> StatusBlock:
    positioning = PositioningStatus(
        state="ready", accepted_command=0, result="none", cycle=0, position_m=0.0, mass_kg=18.9,
        target_m=0.01, target_sequence=1,
    )  # fmt: skip
    return StatusBlock("ready", 1, 0, (), None, replace(positioning, **changed))


class Module(ModuleAcquisition):
    """Shows what it is told to show."""

    shown, connected = block(), True

    @property
    def status(self) -> ModuleStatus:
        return ModuleStatus(connected=self.connected)

    async def read_status(self) -> StatusBlock:
        self.status_block = self.shown
        return self.shown


@pytest.fixture
def module(cell: CellConfig) -> Module:
    return Module(cell.name, ModbusClient(transport_for(module_link(cell))), cell.register_map)


@pytest_asyncio.fixture
async def task(tmp_path: Path, cell: CellConfig, module: Module) -> AsyncIterator[PositioningTask]:
    design = cell_design(cell)
    worker = CellWorker(design, Journal(tmp_path / "j", cell.name), Retention())
    yield PositioningTask(cell, design, module, worker, lambda: None)
    await worker.close()


class Tapper:
    """Moves the part as foretold; the PLC puts another down after the first tap, or lets it lie."""

    def __init__(self, module: Module, task: PositioningTask, *, taken_away: bool) -> None:
        self.module, self.task, self.taken_away, self.taps = module, task, taken_away, 0
        self.position_m = 0.0

    async def tap(self, command: object) -> int:
        self.taps += 1
        tap = self.task._sequence.tap
        assert tap is not None
        self.position_m += tap.expected_m
        another = {"target_sequence": 2, "target_m": 0.02}
        self.module.shown = block(**another) if self.taken_away else block(position_m=self.position_m)
        return self.taps

    async def read_report(self) -> PositioningStatus:
        assert self.module.shown.positioning is not None
        return self.module.shown.positioning


@pytest.mark.parametrize("taken_away", [True, False])
async def test_the_next_part_is_not_taken_for_the_one_that_was_tapped(
    module: Module, task: PositioningTask, taken_away: bool
) -> None:
    tapper = Tapper(module, task, taken_away=taken_away)
    task._positioner = tapper  # type: ignore[assignment]
    await module.read_status()
    await task._read_plc_target()
    await task._drive()
    [outcome] = task.outcomes
    assert outcome.taps == tapper.taps
    assert outcome.settled is not taken_away
    assert ("the PLC" in outcome.reason) is taken_away
    assert task.fault is None
    assert tapper.taps == 1 or not taken_away
    assert task.belief.taps == (0 if taken_away else tapper.taps)


async def test_a_target_that_came_while_the_link_was_down_is_begun_once_it_is_up(
    module: Module, task: PositioningTask
) -> None:
    await module.read_status()
    module.connected = False
    await task._read_plc_target()
    assert task.fault is None
    assert not task.state.running
    module.connected = True
    await task._read_plc_target()
    assert task.state.running


async def test_a_refused_target_of_the_plc_ends_no_task_that_a_person_has_started_meanwhile(
    module: Module, task: PositioningTask
) -> None:
    await module.read_status()
    await asyncio.gather(task.begin(0.005), task._read_plc_target())
    assert task.state.running
    assert task.state.target_m == 0.005
    assert task.fault is None
