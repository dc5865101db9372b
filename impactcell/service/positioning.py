"""Positioning tasks of a running cell: targets in, taps out over Modbus, until the part is in place."""

import asyncio
import contextlib
import logging
import math
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from impactcell.cell import CellDesign
from impactcell.errors import FieldbusError, PositioningError
from impactcell.fieldbus.acquisition import ModuleAcquisition
from impactcell.fieldbus.cycles.status_block import PositioningStatus
from impactcell.fieldbus.positioning_registers import READY
from impactcell.fieldbus.tap_commands import ObjectionError, TapCommand, TapCommander
from impactcell.positioning import PlannerPosterior, task_state_machine
from impactcell.positioning.task_state_machine import TaskOutcome, TaskPhase, TaskState
from impactcell.process.cell_logger import CellLogger
from impactcell.records import Evidence, PositioningState, Snapshot
from impactcell.service.cell_planner import CellPlanner
from impactcell.service.plc_targets import PlcTargets
from impactcell.service.worker import CellWorker
from impactcell.settings import CellConfig

REMEMBERED = 1000
"""Tasks whose outcome is kept."""
WATCH_S = 0.1
"""Between two looks at the PLC's target register."""
BY_PLC = "the PLC, which has a new target"
"""Who aborts a task that another takes the place of."""


class PositioningTask:
    """Drives `impactcell.positioning.task_state_machine` for one cell.

    Parameters
    ----------
    cell : CellConfig
        With a `positioning` section.
    design : CellDesign
    module : ModuleAcquisition
    worker : CellWorker
        Planning runs in its thread; it keeps what the planner has learned.
    changed : callable
        Called when what is to be published has changed.
    """

    def __init__(
        self,
        cell: CellConfig,
        design: CellDesign,
        module: ModuleAcquisition,
        worker: CellWorker,
        changed: Callable[[], None],
    ) -> None:
        self._log = CellLogger(logging.getLogger(__name__), cell.name)
        self._cell = cell.name
        self._planner = CellPlanner(cell, design, module.registers, worker.snapshot)
        if worker.belief is not None:
            self._planner.taps.resume(worker.belief)
        self._module = module
        self._positioner = TapCommander(module)
        self._worker = worker
        self._changed = changed
        self._sequence = TaskState()
        self.outcomes: deque[TaskOutcome] = deque(maxlen=REMEMBERED)
        """Of the last tasks, in their order."""
        self._wake = asyncio.Event()
        self._predictions = self._planner.taps.predictions
        self._plc_targets = PlcTargets()
        self._begun_target: tuple[int, int] | None = None  # session and sequence of the one whose task runs
        self._at_rest = asyncio.Event()  # no tap is under way, also none that was aborted
        self._at_rest.set()
        self._left_at_m = math.nan  # where the tap under way when its task was stopped has left the part

    @property
    def state(self) -> PositioningState:
        """The task as it is published."""
        published, task = self._sequence.published(), self._sequence
        if math.isnan(published.remaining_m):
            published = replace(published, remaining_m=task.target_m - self._left_at_m)
        return replace(published, predictions=self._predictions)

    @property
    def fault(self) -> tuple[str, Evidence] | None:
        """Why the last task stopped, where it was a fault."""
        if self._sequence.phase is not TaskPhase.FAULTED:
            return None
        return self._sequence.reason, self._sequence.evidence or Evidence()

    @property
    def belief(self) -> PlannerPosterior:
        """What the planner has learned."""
        return self._planner.taps.posterior

    async def begin(self, target_m: float) -> None:
        """Start a task.

        Raises
        ------
        PositioningError
            The target is refused; nothing has been commanded.
        """
        before = self._sequence
        await self._begin_from(before, await self._report_at_rest(), target_m)

    async def _begin_from(self, before: TaskState, report: PositioningStatus, target_m: float) -> None:
        started = await self._worker.run(
            lambda: self._planner.begin(before, target_m, report, self._worker.snapshot)
        )
        if self._sequence is not before:
            raise PositioningError(f"{self._cell}: aborted, or another task was started, meanwhile")
        self._set_sequence(started)
        self._wake.set()

    async def abort(self, by: str) -> None:
        """Stop the task that runs, with the tap that is being executed, and one that is still being planned.

        Raises
        ------
        PositioningError
            No further tap is commanded, but the module could not be told so.
        """
        if not self._sequence.running:
            self._sequence = replace(self._sequence)  # what `begin` plans is another's by now
            return
        self._set_sequence(task_state_machine.aborted(self._sequence, by))
        try:
            await self._positioner.abort()
        except FieldbusError as error:
            raise PositioningError(
                f"{self._cell}: no further tap is commanded, but the module could not be told: {error}"
            ) from error

    async def redesign(self, cell: CellConfig, design: CellDesign) -> None:
        """Go on with other limits or another model; what the planner has learned of the contact stays."""
        if await self._worker.run(lambda: self._planner.redesign(cell, design)):
            self._worker.belief = self.belief
        self._predictions = self._planner.taps.predictions

    def update_friction(self, snapshot: Snapshot) -> None:
        """Take over the friction that the tracker believes in; call it in the worker's thread."""
        self._planner.update_friction(snapshot)

    async def run(self) -> None:
        """Run until cancelled; a task whose tap was interrupted by a fault of the cell is over."""
        if self._sequence.phase is TaskPhase.WAITING:
            reason = f"{self._cell}: interrupted during tap {self._sequence.taps}; set the target again"
            self._set_sequence(task_state_machine.failed(self._sequence, reason))
        self._wake.set()
        async with asyncio.TaskGroup() as group:
            group.create_task(self._watch_plc(), name=f"{self._cell} PLC target")
            while True:
                await self._wake.wait()
                self._wake.clear()
                await self._drive()

    async def _watch_plc(self) -> None:
        stored = self._worker.handled_target
        while True:
            await self._read_plc_target()
            if self._worker.handled_target != stored:
                stored = self._worker.handled_target
                await self._worker.record()
            await asyncio.sleep(WATCH_S)

    async def _read_plc_target(self) -> None:
        """Start a task where the PLC has raised the sequence of its target; a 0 is none, and changes nothing.

        After a restart, of service or module, there may still be one whose task has ended: nobody wants that
        again. One that was not over when the service ended goes on from where the part lies.
        """
        block = self._module.status_block
        shown = None if block is None else block.positioning
        if block is None or shown is None or not self._module.status.connected:
            return  # it is still there once the link is up again
        target = (block.session, shown.target_sequence)
        is_new, why_not = self._plc_targets.is_new(*target, shown.target_m, self._worker.handled_target)
        if is_new:
            await self._begin_for_plc(target, shown.target_m)
        elif why_not:
            self._log.warning(why_not)
            self._worker.handled_target = target

    async def _begin_for_plc(self, target: tuple[int, int], target_m: float) -> None:
        if self._sequence.running:
            try:
                await self.abort(BY_PLC)
            except PositioningError as error:
                self._log.warning("%s", error)
        before = self._sequence
        try:
            report = await self._report_at_rest()
            if self._plc_targets.is_another(report.target_sequence):
                return  # that one is looked at next
            await self._begin_from(before, report, target_m)
        except PositioningError as error:
            self._log.warning("the PLC's target is refused: %s", error)
            self._worker.handled_target = target
            if self._sequence is before:  # nobody has set a target, or aborted, meanwhile
                self._set_sequence(TaskState(TaskPhase.FAULTED, reason=str(error), evidence=Evidence()))
        else:
            self._begun_target = target
            if not self._sequence.running:  # in place already
                self._worker.handled_target, self._begun_target = target, None

    async def _drive(self) -> None:
        """Command and observe, tap by tap, until the task no longer runs."""
        while self._sequence.phase is TaskPhase.COMMANDING:
            tap = self._sequence.tap
            assert tap is not None  # noqa: S101 - COMMANDING has one
            waiting = task_state_machine.commanded(self._sequence)
            self._set_sequence(waiting)
            self._at_rest.clear()
            fault, report, next_state = "", None, self._planner.observe
            try:
                command = TapCommand(tap.velocity_m_s, tap.stroke_m, tap.direction)
                report = await self._positioner.tap(command, partial(self._objection, waiting))
            except ObjectionError as objected:
                report, fault = objected.report, str(objected) if objected.sent else ""
                next_state = self._planner.replan
            except FieldbusError as error:
                fault = f"{self._cell}: {error}"
            except PositioningError as error:
                fault = str(error)
            finally:
                self._at_rest.set()
            if self._sequence is waiting:
                if report is not None and self._plc_targets.is_another(report.target_sequence):
                    # Another part lies there by now: its position says nothing of the tap.
                    self._set_sequence(task_state_machine.aborted(waiting, BY_PLC))
                    return
                if fault:
                    self._set_sequence(task_state_machine.failed(waiting, fault))
            if report is None or self._sequence is not waiting:  # what came of it is no other task's business
                await self._show_where_left()
                continue
            after = await self._worker.run(partial(next_state, waiting, report.position_m))
            self._worker.belief = self.belief
            self._predictions = self._planner.taps.predictions
            if self._sequence is waiting:
                self._set_sequence(after)

    def _objection(self, waiting: TaskState, report: PositioningStatus) -> str:
        """Say why a tap is not to be made any more, from what the module shows right before it is told to."""
        if self._sequence is not waiting:
            return "aborted"
        if self._plc_targets.is_another(report.target_sequence):
            return f"aborted by {BY_PLC}"
        if not self._planner.is_planned_from(waiting, report.position_m):
            return "the part no longer lies where the tap was planned from"
        return ""

    async def _show_where_left(self) -> None:
        """Publish where the part has come to rest, unless another task has begun meanwhile."""
        with contextlib.suppress(FieldbusError, PositioningError):  # then it is not known
            report = await self._positioner.read_report_at_rest()
            if not self._sequence.running:
                self._left_at_m = report.position_m
                self._changed()

    async def _report_at_rest(self) -> PositioningStatus:
        """Return what the module says once no tap is under way, also none of a service before this one."""
        block = None if self._module.status_block is None else self._module.status_block.positioning
        if block is None or not self._module.status.connected:
            raise PositioningError(
                f"{self._cell}: the module does not answer, or has no positioning registers"
            )
        if self._sequence.running or (self._at_rest.is_set() and block.state == READY):
            return block
        await self._at_rest.wait()
        return await self._positioner.read_report_at_rest()

    def _set_sequence(self, now: TaskState) -> None:
        if now is not self._sequence:
            if self._sequence.running and not now.running:
                self.outcomes.append(now.outcome)
                if self._begun_target is not None:
                    self._worker.handled_target, self._begun_target = self._begun_target, None
            self._sequence, self._left_at_m = now, math.nan
            self._changed()
