"""One running cell: cycles in from its module, snapshots out to OPC UA."""

import asyncio
import contextlib
import logging
import time
from collections.abc import Awaitable, Callable
from dataclasses import replace
from functools import partial

from impactcell.alarms.rules import positioning_fault
from impactcell.errors import ImpactCellError, PositioningError
from impactcell.fieldbus.acquisition import ModuleAcquisition, ReceivedCycle
from impactcell.fieldbus.map_promises import not_promised
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.transports import Transport, transport_for
from impactcell.journal.audit_entries import AuditEntry
from impactcell.positioning.task_state_machine import TaskOutcome
from impactcell.process.cell_logger import CellLogger
from impactcell.process.condition_log import ConditionLog
from impactcell.records import BatchAnnouncement, Evidence, ModuleStatus, PositioningState, Snapshot
from impactcell.records.uncertainty import plus_minus
from impactcell.scada import Server
from impactcell.service.factory import cell_design
from impactcell.service.fault_alarms import FaultAlarms
from impactcell.service.monitoring import CellHealth
from impactcell.service.opening import opened_worker
from impactcell.service.positioning import PositioningTask
from impactcell.service.publisher import CellPublisher
from impactcell.service.reloading import model_time_ns, reloaded_cell
from impactcell.settings import CellConfig
from impactcell.web.live_feed import LiveFeed

TICK_S = 1.0
"""Between two looks at shelved alarms, the journal's backlog and the model file, seconds."""
STALE_PERIODS = 10.0
"""So many periods without a cycle, and values count as stale ..."""
STALE_AT_LEAST_S = 5.0
"""... but not before so many seconds."""

SnapshotCallback = Callable[[str, Snapshot], None]


class CellTask:
    """Module, worker and nodes of one cell.

    Parameters
    ----------
    cell : CellConfig
    on_snapshot : callable, optional
        Called with the cell's name and each snapshot, after it was published.

    Raises
    ------
    JournalError
        The journal cannot be opened.
    """

    def __init__(
        self,
        cell: CellConfig,
        on_snapshot: SnapshotCallback | None = None,
        transport: Transport | None = None,
    ) -> None:
        self.cell = cell
        self.log = CellLogger(logging.getLogger(__name__), cell.name)
        self.worker = opened_worker(cell)
        self._publisher = CellPublisher(cell.name, self.worker.alarms, self._positioning_state, self.log)
        self._conditions = ConditionLog(self.log)
        self._fault_alarms = FaultAlarms(self.worker, self.log)
        self._on_snapshot = on_snapshot
        self._link_changes: asyncio.Queue[ModuleStatus] = asyncio.Queue()
        self._module = ModuleAcquisition(
            cell.name,
            ModbusClient(transport or transport_for(cell.settings.module.link)),
            cell.register_map,
            self._take_link_change,
        )
        for text in not_promised(cell.register_map):
            self.log.info("register map %s: %s", cell.register_map.name, text)
        self._positioning_change = asyncio.Event()
        self._positioning: PositioningTask | None = None
        if cell.settings.positioning is not None:
            self._positioning = PositioningTask(
                cell, cell_design(cell), self._module, self.worker, self._positioning_change.set
            )
        self._last_cycle_s = time.monotonic()
        self._stale = False
        self._model_seen_ns = model_time_ns(cell)

    @property
    def status(self) -> ModuleStatus:
        """State of the link and counts; a cycle that the journal lost counts as missed, for nobody has it."""
        return self._with_losses(self._module.status)

    @property
    def health(self) -> CellHealth:
        """What monitoring shows of the cell."""
        status, snapshot = self.status, self.worker.snapshot
        return CellHealth(
            cell=self.cell.name,
            cycles=status.received,
            missed=status.missed,
            last_cycle=snapshot.cycle if snapshot else 0,
            round_trip_s=status.round_trip_s,
            mu_s=snapshot.friction.mu_s.value if snapshot else float("nan"),
            wear_level=snapshot.wear.level if snapshot else float("nan"),
            alarms={alarm.name: alarm.active for alarm in self.worker.alarms},
            link_fault="" if status.connected else status.reason,
            journal_fault=self.worker.journal_fault,
        )

    @property
    def task_outcomes(self) -> tuple[TaskOutcome, ...]:
        """What became of the last positioning tasks, in their order."""
        return () if self._positioning is None else tuple(self._positioning.outcomes)

    async def run(self, server: Server, feed: LiveFeed | None = None) -> None:
        """Run until cancelled, shown by a server and on a page."""
        self._publisher.server, self._publisher.feed = server, feed
        self.worker.tell_alarms(self._publisher.publish_alarms)
        self._publish_restored()
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self._acquire(), name=f"{self.cell.name} cycles")
                group.create_task(self._tell_link(), name=f"{self.cell.name} link")
                if self._positioning is not None:
                    group.create_task(self._positioning.run(), name=f"{self.cell.name} taps")
                    group.create_task(self._publish_positioning(), name=f"{self.cell.name} positioning")
                group.create_task(self._tick(), name=f"{self.cell.name} clock")
        finally:
            await self._module.close()

    async def close(self) -> int:
        """Finish what has begun, and close the journal; says how many entries it could not take."""
        return await self.worker.close()

    async def reload(self) -> None:
        """Take over from the cell's files what can change without a restart: model, tracking, alarms."""
        self._model_seen_ns = model_time_ns(self.cell)
        try:
            self.cell = await asyncio.to_thread(reloaded_cell, self.cell, self.log)
        except ImpactCellError as error:
            self.log.warning("not reloaded, all goes on as before: %s", error)
            return
        design = cell_design(self.cell)
        await self.worker.redesign(design)
        if self._positioning is not None:
            await self._positioning.redesign(self.cell, design)
        self.log.info("reloaded; model %s", self.cell.model.name)

    async def set_target(self, target_m: float, audit: AuditEntry) -> None:
        """Start a positioning task.

        Raises
        ------
        PositioningError
            The cell has no positioning, or refuses the target; nothing has been commanded.
        """
        await self._audited(lambda task: task.begin(target_m), audit)

    async def abort_positioning(self, audit: AuditEntry) -> None:
        """End the positioning task that runs.

        Raises
        ------
        PositioningError
            The cell has no positioning.
        """
        await self._audited(lambda task: task.abort(audit.user), audit)

    async def _audited(self, act: Callable[[PositioningTask], Awaitable[None]], audit: AuditEntry) -> None:
        try:
            await act(self._positioning_task())
        except PositioningError as error:
            audit = replace(audit, result=str(error))
            raise
        finally:
            await self.worker.record(audit)

    def _positioning_task(self) -> PositioningTask:
        if self._positioning is None:
            raise PositioningError(
                f"{self.cell.name}: this cell has no positioning; add it to {self.cell.path}"
            )
        return self._positioning

    async def _acquire(self) -> None:
        await self.worker.warm_up()
        self._module.note_durable(self.worker.durable)
        last_ns = 0 if self.worker.snapshot is None else self.worker.snapshot.time_ns
        before = await self.worker.taken_before()
        async with contextlib.aclosing(
            self._module.captures(self.worker.last, last_ns, before)
        ) as received_cycles:
            async for received in received_cycles:
                await self._process(received)

    async def _process(self, received: ReceivedCycle) -> None:
        capture = received.capture
        task = self._positioning
        result = await self.worker.process(
            capture,
            self._positioning_state(),
            self._announcement(),
            received.faults,
            restarted=received.restarted,
        )
        await self.worker.note_serial_number(self._module.serial_number)
        if task is not None:
            await self.worker.run(partial(task.update_friction, result.snapshot))
        snapshot, notes = result.snapshot, result.notes
        self._conditions.update(notes, capture.cycle)
        self._last_cycle_s, self._stale = time.monotonic(), False
        self._publisher.publish(snapshot, capture)
        self._publisher.publish_module(self.status)
        mu_s, late_s = snapshot.friction.mu_s, time.time() - 1e-9 * capture.time_ns
        self.log.debug(
            "mu_s %s (%s), gap %.2f, published %s after its end",
            plus_minus(mu_s.value, mu_s.std, ".4f"), mu_s.quality.name.lower(), snapshot.friction.gap,
            f"{1e3 * late_s:.0f} ms" if capture.time_ns else "some time", cycle=capture.cycle,
        )  # fmt: skip
        await self._module.acknowledge(self.worker.durable)
        await self._fault_alarms.check_journal()
        if self._on_snapshot is not None:
            self._on_snapshot(self.cell.name, snapshot)

    def _positioning_state(self) -> PositioningState:
        return PositioningState() if self._positioning is None else self._positioning.state

    async def _publish_positioning(self) -> None:
        """Publish the task between cycles too, and raise or clear its alarm."""
        while True:
            await self._positioning_change.wait()
            self._positioning_change.clear()
            task = self._positioning_task()
            if self.worker.snapshot is not None:
                self._publisher.publish_positioning(self.worker.snapshot)
            fault = task.fault
            reason, evidence = fault or ("", Evidence())
            await self.worker.apply_rule_result(positioning_fault.result(reason, evidence), time.time_ns())

    def _announcement(self) -> BatchAnnouncement | None:
        status_block = self._module.status_block
        if status_block is None or status_block.batch is None or not status_block.batch.sequence:
            return None
        return status_block.batch

    def _with_losses(self, status: ModuleStatus) -> ModuleStatus:
        return replace(status, missed=status.missed + self.worker.lost)

    def _take_link_change(self, status: ModuleStatus) -> None:
        """Show it at once, before any cycle that comes over the new link; its alarm follows."""
        self._publisher.publish_link(self._with_losses(status))
        if status.connected:  # the values are those of before, and good again with the next cycle
            self._mark_stale()
        self._link_changes.put_nowait(status)

    async def _tell_link(self) -> None:
        while True:
            await self._fault_alarms.tell_link(await self._link_changes.get())

    def _mark_stale(self) -> None:
        self._stale = True
        self._publisher.mark_stale(time.time_ns())

    async def _tick(self) -> None:
        while True:
            await asyncio.sleep(TICK_S)
            await self.worker.expire_shelving(time.time_ns())
            self._publisher.publish_start(self.status)
            if (status := self._module.status).reason:
                await self._fault_alarms.tell_link(status)
            silent_s = time.monotonic() - self._last_cycle_s
            late = silent_s > max(STALE_AT_LEAST_S, STALE_PERIODS * self.worker.period_s)
            if late and not self._stale and self._module.status.connected:
                self._mark_stale()
            await self.worker.retry()
            self._module.note_durable(self.worker.durable)
            await self._fault_alarms.check_journal()
            if model_time_ns(self.cell) not in (0, self._model_seen_ns):
                await self.reload()

    def _publish_restored(self) -> None:
        self._publisher.publish_alarms(self.worker.alarms, unchanged=True)
        self._publisher.publish_module(self.status)
        if self.worker.snapshot is not None:
            self._publisher.publish(self.worker.snapshot)
            self._publisher.mark_stale(self.worker.snapshot.time_ns)
        self._publisher.publish_start(self.status)
