"""A module that shows what a test tells it to, for the positioning task of a cell."""

import asyncio
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from impactcell.fieldbus.acquisition import ModuleAcquisition, ModuleStatus
from impactcell.fieldbus.cycles.status_block import PositioningStatus, StatusBlock
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.tap_commands import Objection, ObjectionError, TapCommand
from impactcell.fieldbus.transports import transport_for
from impactcell.journal.retention import Retention
from impactcell.journal.store import Journal
from impactcell.service.factory import cell_design
from impactcell.service.positioning import PositioningTask
from impactcell.service.worker import CellWorker
from impactcell.settings import CellConfig


def block(**changed: Any) -> StatusBlock:
    """Return what a ready module shows of a part at 0, wanted at 10 mm."""
    positioning = PositioningStatus(
        state="ready", accepted_command=0, result="none", cycle=0, position_m=0.0, mass_kg=18.9,
        target_m=0.01, target_sequence=1,
    )  # fmt: skip
    return StatusBlock("ready", 1, 0, (), None, replace(positioning, **changed))


class ToldModule(ModuleAcquisition):
    """Shows what it is told to show."""

    shown, connected = block(), True

    @classmethod
    def of(cls, cell: CellConfig) -> "ToldModule":
        """Make the module of a cell; nothing is ever sent to it."""
        return cls(cell.name, ModbusClient(transport_for(cell.settings.module.link)), cell.register_map)

    @property
    def status(self) -> ModuleStatus:
        """Whether it is connected is told, too."""
        return ModuleStatus(connected=self.connected)

    async def read_status(self) -> StatusBlock:
        """Show it."""
        self._shown = self.shown
        return self.shown


def worker_of(cell: CellConfig, journal: Path) -> CellWorker:
    """Open a worker of the cell on a journal."""
    return CellWorker(cell_design(cell), Journal(journal, cell.name), Retention())


def task_of(cell: CellConfig, module: ModuleAcquisition, worker: CellWorker) -> PositioningTask:
    """Make the task of the cell."""
    return PositioningTask(cell, cell_design(cell), module, worker, lambda: None)


class Commander:
    """Asks as a `TapCommander` does, right before each strike, and moves the part as foretold."""

    before_strike: Callable[[], object]
    sent = False

    def __init__(self, module: ToldModule, task: PositioningTask) -> None:
        self.module, self.task = module, task
        self.struck_from: list[float] = []
        self.before_strike = lambda: None
        self.rests = asyncio.Event()
        self.rests.set()
        task._positioner = self  # type: ignore[assignment]

    @property
    def shown(self) -> PositioningStatus:
        assert self.module.shown.positioning is not None
        return self.module.shown.positioning

    def show(self, **changed: Any) -> None:
        self.module.shown = replace(self.module.shown, positioning=replace(self.shown, **changed))

    async def tap(self, _command: TapCommand, objection: Objection) -> PositioningStatus:
        self.before_strike()
        if why := objection(self.shown):
            struck = "the part may have been struck" if self.sent else "nothing has been commanded"
            raise ObjectionError(f"{why}; {struck}", self.shown, sent=self.sent)
        tap = self.task._sequence.tap
        assert tap is not None
        self.struck_from.append(self.shown.position_m)
        self.show(position_m=self.shown.position_m + tap.direction * tap.expected_m)
        return self.shown

    async def read_report_at_rest(self) -> PositioningStatus:
        await self.rests.wait()
        return self.shown
