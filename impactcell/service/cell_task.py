"""One running cell: cycles in from its module, snapshots out to OPC UA."""

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from impactcell.alarms import RuleResult
from impactcell.errors import ImpactCellError, JournalError, PositioningError
from impactcell.fieldbus.acquisition import Module, Reception
from impactcell.journal.retention import Retention
from impactcell.journal.store import AuditEntry, Journal
from impactcell.process.cell_logger import CellLogger
from impactcell.records import (
    Alarm,
    AlarmName,
    BatchAnnouncement,
    Evidence,
    ModuleStatus,
    PositioningState,
    Snapshot,
)
from impactcell.scada import Server
from impactcell.service.factory import cell_design, module_link, retention
from impactcell.service.monitoring import CellHealth
from impactcell.service.positioning import PositioningTask
from impactcell.service.worker import Worker
from impactcell.settings import Cell, read_cell

TICK_S = 1.0
STALE_PERIODS = 10.0
STALE_AT_LEAST_S = 5.0
_TOLD_ELSEWHERE = (AlarmName.MODULE_CONNECTION, AlarmName.JOURNAL_FAULT)

Observer = Callable[[str, Snapshot], None]


class RunningCell:
    """Module, worker and nodes of one cell.

    Parameters
    ----------
    cell : Cell
    observe : callable, optional
        Called with the cell's name and each snapshot, after it was published.

    Raises
    ------
    JournalError
        The journal cannot be opened.
    """

    def __init__(self, cell: Cell, observe: Observer | None = None) -> None:
        self.cell = cell
        self.log = CellLogger(logging.getLogger(__name__), cell.name)
        settings = cell.settings.journal
        journal = None if settings is None else Journal(settings.file, cell.name)
        keep = Retention() if settings is None else retention(settings)
        try:
            self.worker = Worker(cell_design(cell), journal, keep)
        except JournalError:
            if journal is not None:
                journal.close()
            raise
        self.server: Server | None = None
        self._notes: tuple[str, ...] = ()
        self._active = {alarm.name for alarm in self.worker.alarms if alarm.active}
        self._observe = observe
        self._module = Module(cell.name, module_link(cell), cell.register_map, self._link_changed)
        self._positioning: PositioningTask | None = None
        if cell.settings.positioning is not None:
            self._positioning = PositioningTask(
                cell, cell_design(cell), self._module, self.worker, self._positioning_changed
            )
        self._positioning_news = asyncio.Event()
        self._link_news: asyncio.Queue[ModuleStatus] = asyncio.Queue()
        self._last_cycle_s = time.monotonic()
        self._stale = False
        self._model_seen_ns = self._model_time_ns()

    @property
    def status(self) -> ModuleStatus:
        """State of the link and counts."""
        return self._module.status

    @property
    def health(self) -> CellHealth:
        """What monitoring shows of the cell."""
        status, snapshot = self._module.status, self.worker.snapshot
        return CellHealth(
            cell=self.cell.name,
            connected=status.connected,
            cycles=status.received,
            missed=status.missed,
            last_cycle=snapshot.cycle if snapshot else 0,
            round_trip_ms=status.round_trip_s * 1e3,
            mu_s=snapshot.friction.mu_s.value if snapshot else float("nan"),
            wear_level=snapshot.wear.level if snapshot else float("nan"),
            alarms_active=sum(alarm.active for alarm in self.worker.alarms),
            journal_ok=not self.worker.journal_fault,
        )

    async def run(self, server: Server) -> None:
        """Run until cancelled."""
        self.server = server
        self._show_restored(server)
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self._acquire(), name=f"{self.cell.name} cycles")
                group.create_task(self._follow_link(), name=f"{self.cell.name} link")
                if self._positioning is not None:
                    group.create_task(self._positioning.run(), name=f"{self.cell.name} taps")
                    group.create_task(self._follow_positioning(), name=f"{self.cell.name} positioning")
                group.create_task(self._tick(), name=f"{self.cell.name} clock")
        finally:
            await self._module.close()

    async def close(self) -> None:
        """Finish what has begun, and close the journal."""
        await self.worker.close()

    async def reload(self) -> None:
        """Take over from the cell's files what can change without a restart: model, tracking, alarms."""
        self._model_seen_ns = self._model_time_ns()
        try:
            fresh = await asyncio.to_thread(read_cell, self.cell.path)
        except ImpactCellError as error:
            self.log.warning("not reloaded, all goes on as before: %s", error)
            return
        fixed = {
            name: getattr(self.cell.settings, name)
            for name in ("cell", "module", "opcua", "journal", "monitoring", "identification", "positioning")
            if getattr(fresh.settings, name) != getattr(self.cell.settings, name)
        }
        if fixed:
            self.log.warning("changed, but taken over only by a restart: %s", ", ".join(fixed))
        self.cell = replace(self.cell, settings=fresh.settings.model_copy(update=fixed), model=fresh.model)
        design = cell_design(self.cell)
        await self.worker.redesign(design)
        if self._positioning is not None:
            self._positioning.redesign(design)
        self.log.info("reloaded; model %s", fresh.model.name)

    async def set_target(self, target_m: float, audit: AuditEntry) -> None:
        """Start a positioning task.

        Raises
        ------
        PositioningError
            The cell has no positioning, or refuses the target; nothing has been commanded.
        """
        try:
            await self._positioning_task().begin(target_m)
        except PositioningError as error:
            await self.worker.note(replace(audit, result=str(error)))
            raise
        await self.worker.note(audit)

    async def abort_positioning(self, audit: AuditEntry) -> None:
        """End the positioning task that runs."""
        await self._positioning_task().abort(audit.user)
        await self.worker.note(audit)

    def _positioning_task(self) -> PositioningTask:
        if self._positioning is None:
            raise PositioningError(
                f"{self.cell.name}: this cell has no positioning; add it to {self.cell.path}"
            )
        return self._positioning

    async def _acquire(self) -> None:
        await self.worker.rehearse()
        async with contextlib.aclosing(
            self._module.captures(after=self.worker.last or self.worker.durable)
        ) as receptions:
            async for reception in receptions:
                await self._take(reception)

    async def _take(self, reception: Reception) -> None:
        capture = reception.capture
        task = self._positioning
        positioning = PositioningState() if task is None else task.state
        processed = await self.worker.process(capture, positioning, self._announcement(), reception.faults)
        if task is not None:
            await self.worker.run(partial(task.learn, processed.stepped.snapshot))
        snapshot, notes = processed.stepped.snapshot, processed.stepped.notes
        for note in notes:
            if note not in self._notes:
                self.log.info("%s", note, cycle=capture.cycle)
        self._notes = notes
        self._last_cycle_s, self._stale = time.monotonic(), False
        if self.server is not None:
            self.server.publish(self.cell.name, snapshot)
            self._show_module(self.server)
        self._tell(processed.stepped.changed)
        mu_s, late_s = snapshot.friction.mu_s, time.time() - 1e-9 * capture.time_ns
        self.log.debug(
            "mu_s %.4f ± %.4f (%s), gap %.2f, published %s after its end",
            mu_s.value, mu_s.std, mu_s.quality.name.lower(), snapshot.friction.gap,
            f"{1e3 * late_s:.0f} ms" if capture.time_ns else "some time", cycle=capture.cycle,
        )  # fmt: skip
        if processed.durable is not None:
            await self._module.acknowledge(processed.durable)
        await self._look_at_journal()
        if self._observe is not None:
            self._observe(self.cell.name, snapshot)

    def _positioning_changed(self) -> None:
        self._positioning_news.set()

    async def _follow_positioning(self) -> None:
        """Publish the task between cycles too, and raise or clear its alarm."""
        while True:
            await self._positioning_news.wait()
            self._positioning_news.clear()
            task = self._positioning_task()
            if self.server is not None and self.worker.snapshot is not None:
                snapshot = replace(self.worker.snapshot, positioning=task.state, alarms=self.worker.alarms)
                self.server.publish(self.cell.name, snapshot)
            fault = task.fault
            reason, evidence = fault or ("", Evidence())
            await self._find(RuleResult(AlarmName.POSITIONING_FAULT, fault is not None, reason, evidence))

    def _announcement(self) -> BatchAnnouncement | None:
        report = self._module.report
        if report is None or report.batch is None or not report.batch.sequence:
            return None
        return report.batch

    def _link_changed(self, status: ModuleStatus) -> None:
        self._link_news.put_nowait(status)

    async def _follow_link(self) -> None:
        while True:
            status = await self._link_news.get()
            if self.server is not None:
                if not status.connected:
                    self.server.mark_bad(self.cell.name, time.time_ns())
                self._show_module(self.server)
            await self._find(RuleResult(AlarmName.MODULE_CONNECTION, not status.connected, status.reason))

    async def _look_at_journal(self) -> None:
        fault = self.worker.journal_fault
        active = any(a.active for a in self.worker.alarms if a.name is AlarmName.JOURNAL_FAULT)
        if bool(fault) != active:
            if fault:
                self.log.error("%s", fault)
            await self._find(RuleResult(AlarmName.JOURNAL_FAULT, bool(fault), fault, Evidence()))

    async def _find(self, finding: RuleResult) -> None:
        self._show_alarms(await self.worker.find(finding, time.time_ns()))

    async def _tick(self) -> None:
        while True:
            await asyncio.sleep(TICK_S)
            self._show_alarms(await self.worker.pass_time(time.time_ns()))
            silent_s = time.monotonic() - self._last_cycle_s
            late = silent_s > max(STALE_AT_LEAST_S, STALE_PERIODS * self.worker.period_s)
            if late and not self._stale and self.server is not None and self._module.status.connected:
                self._stale = True
                self.server.mark_stale(self.cell.name, time.time_ns())
            await self.worker.retry()
            await self._look_at_journal()
            if self._model_time_ns() not in (0, self._model_seen_ns):
                await self.reload()

    def _model_time_ns(self) -> int:
        """When the model file was written; 0 while it is being replaced, or cannot be seen."""
        try:
            return self.cell.settings.model.stat().st_mtime_ns
        except OSError:
            return 0

    def _show_restored(self, server: Server) -> None:
        self._show_alarms(self.worker.alarms)
        self._show_module(server)
        if self.worker.snapshot is not None:
            server.publish(self.cell.name, self.worker.snapshot)
            server.mark_stale(self.cell.name, self.worker.snapshot.time_ns)

    def _show_alarms(self, moved: tuple[Alarm, ...]) -> None:
        self._tell(moved)
        if self.server is not None:
            for alarm in moved:
                self.server.alarm(self.cell.name, alarm)

    def _tell(self, moved: tuple[Alarm, ...]) -> None:
        """Log each alarm that comes or goes, but for those that their finder has told of already."""
        for alarm in moved:
            if alarm.active != (alarm.name in self._active) and alarm.name not in _TOLD_ELSEWHERE:
                said = "alarm %s is active: %s" if alarm.active else "alarm %s is over: %s"
                level = logging.WARNING if alarm.active else logging.INFO
                self.log.log(level, said, alarm.name.value, alarm.message, cycle=alarm.cycle or None)
            (self._active.add if alarm.active else self._active.discard)(alarm.name)

    def _show_module(self, server: Server) -> None:
        server.module(self.cell.name, self._module.status, time.time_ns())
