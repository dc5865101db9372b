"""The state of one cell and its journal, in a thread of their own: estimators stay off the event loop."""

import asyncio
import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import TypeVar

from impactcell import cell as core
from impactcell.alarms import AlarmEvent, RuleResult, Transition
from impactcell.cell import CellDesign, CellState, StepResult
from impactcell.fieldbus.cycles.taken_cycles import TakenBefore
from impactcell.journal.audit_entries import AuditEntry
from impactcell.journal.retention import Retention
from impactcell.journal.store import Journal
from impactcell.journal.stored_forms import MODEL, StoredState, pack_state
from impactcell.process.cell_logger import CellLogger
from impactcell.records import (
    Alarm,
    BatchAnnouncement,
    Capture,
    CycleId,
    PositioningState,
    Shelving,
    Snapshot,
)
from impactcell.serialization.tree import Unknown
from impactcell.service.guarded_step import guarded_step
from impactcell.service.journal_writer import JournalWriter
from impactcell.service.restoring import restored_state
from impactcell.service.warmup import warm_up, warm_up_for_changes

T = TypeVar("T")


class CellWorker:
    """Applies `impactcell.cell` to one cell, one thing after the other, and stores what came of it.

    Every public coroutine runs its work in the cell's own thread, in the order of the calls.

    Parameters
    ----------
    design : CellDesign
    journal : Journal or None
        None keeps nothing over a restart.
    keep : Retention

    Raises
    ------
    ForeignJournalError
        The journal's state is of another version, or damaged; it is left as it is.
    """

    def __init__(self, design: CellDesign, journal: Journal | None, keep: Retention) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix=f"cell-{design.name}")
        self._design = design
        self.log = CellLogger(logging.getLogger(__name__), design.name)
        self._journal_writer = JournalWriter(design.name, journal, keep)
        self._closing = threading.Event()
        self._unknown = Unknown()
        """Alarms of another version that are kept for it."""
        restored = restored_state(self._journal_writer, design, self._unknown)
        self._state, self._snapshot = restored.cell, restored.snapshot
        self.belief = restored.planner
        self.handled_target = restored.handled_target
        """Session and sequence of the PLC's last target whose task has ended; `record` stores it."""
        self.last = restored.last
        """The last cycle taken in, durable or not; None: none ever."""
        self._fit_state()
        self._told = self.alarms
        self._tell_alarms: Callable[[tuple[Alarm, ...]], object] | None = None
        self._store_model()

    @property
    def alarms(self) -> tuple[Alarm, ...]:
        """Alarms as they are now."""
        return self._state.alarms.alarms

    @property
    def snapshot(self) -> Snapshot | None:
        """The last cycle; after a restart the one before it, None if there was none."""
        return self._snapshot

    @property
    def period_s(self) -> float:
        """Mean time between cycles, 0 before it is known."""
        return self._state.period_s

    @property
    def durable(self) -> CycleId | None:
        """The last cycle that is safely stored, None: none yet; without a journal the last one taken in."""
        writer = self._journal_writer
        return self.last if writer.journal is None else writer.durable

    async def taken_before(self) -> TakenBefore:
        """Return what the journal knows of what was taken before; nothing without a journal."""
        return await self.run(self._journal_writer.taken_before)

    async def note_serial_number(self, serial_number: str) -> None:
        """Keep which module made the cycle that was taken in last."""
        if serial_number != self._journal_writer.serial_number:
            await self.run(lambda: self._journal_writer.store_serial_number(serial_number))

    @property
    def lost(self) -> int:
        """Cycles that were taken in and could not be stored; they never will be."""
        return self._journal_writer.lost

    @property
    def journal_fault(self) -> str:
        """Why something was not stored, or is not yet; empty while all is."""
        return self._journal_writer.fault

    def tell_journal_event(self, event: str) -> None:
        """Say what happened to the journal before it was given to this worker."""
        self._journal_writer.report(event)

    def take_journal_events(self) -> list[str]:
        """Return what happened to the journal since the last call, also if all is well again."""
        return self._journal_writer.take_events()

    async def warm_up(self) -> None:
        """Compile what a cycle needs, so that the first one is not late; then what a change needs.

        It runs in a thread that nobody waits for: compiling cannot be interrupted, and must not hold up
        an end of the service.
        """
        loop, transition = asyncio.get_running_loop(), asyncio.Event()

        def work() -> None:
            try:
                warm_up(self._design, self._closing.is_set)
            except Exception:
                self.log.exception("the warm-up failed; the first cycle will be slow")
            if self._closing.is_set():
                return
            loop.call_soon_threadsafe(transition.set)
            try:
                warm_up_for_changes(self._design, self._closing.is_set)
            except Exception:
                self.log.exception("the warm-up failed; the first change will be slow")

        threading.Thread(target=work, name=f"warm-up-{self._design.name}", daemon=True).start()
        await transition.wait()

    async def process(
        self,
        capture: Capture,
        positioning: PositioningState,
        announcement: BatchAnnouncement | None,
        faults: tuple[str, ...] = (),
        *,
        restarted: bool = False,
    ) -> StepResult:
        """Take one cycle through the pipeline and store it."""

        def step() -> StepResult:
            given = self._state, capture, positioning, announcement, faults
            return guarded_step(self.log, self._design, *given, restarted=restarted)

        processed = await self.run(lambda: self._process(capture, step))
        if self._journal_writer.maintenance_due:
            self._thread.submit(self._maintain, capture.time_ns)  # what is shown need not wait for it
        return processed

    async def apply_rule_result(self, rule_result: RuleResult, time_ns: int) -> None:
        """Take what a rule beside the cycles says."""
        await self.run(lambda: self._apply_rule_result(rule_result, time_ns))

    async def expire_shelving(self, time_ns: int) -> None:
        """End every shelving whose time is over."""
        if any(alarm.shelving is not Shelving.UNSHELVED for alarm in self.alarms):
            await self.run(lambda: self._expire_shelving(time_ns))

    async def apply_event(self, name: str, event: AlarmEvent, audit: AuditEntry) -> Transition:
        """Apply a person's action on a condition, and write down who did it."""
        return await self.run(lambda: self._apply_event(name, event, audit))

    async def change_state(self, change_state: Callable[[CellState], CellState], audit: AuditEntry) -> None:
        """Change the state by a person's command, and write down who did it."""
        await self.run(lambda: self._record(change_state(self._state), audit))

    async def retry(self) -> None:
        """Try again to write what the journal could not take, also while no cycles come."""
        if self._journal_writer.has_backlog:
            await self.run(self._journal_writer.retry)

    async def record(self, audit: AuditEntry | None = None) -> None:
        """Store the state now, with what a person did that is not in it."""
        await self.run(lambda: self._record(self._state, audit))

    async def redesign(self, design: CellDesign) -> None:
        """Go on with other settings or another model, from the next cycle on."""

        def swap() -> None:
            self._design = design
            self._fit_state()
            self._store_model()

        await self.run(swap)

    async def close(self) -> int:
        """Finish what has begun, and close the journal; says how many entries it could not take."""
        self._closing.set()
        lost = await self.run(self._journal_writer.close)
        self._thread.shutdown(wait=False)
        return lost

    async def run(self, work: Callable[[], T]) -> T:
        """Do some work in the cell's thread, after all that was asked for before."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, self._told_after, work)

    def tell_alarms(self, tell: Callable[[tuple[Alarm, ...]], object]) -> None:
        """Have all alarms told to the running loop whenever work has changed one, before the work is over.

        They come in the order in which they changed; nothing else may carry them to where they are shown, or
        an older state could overwrite a newer one.
        """
        loop = asyncio.get_running_loop()
        self._tell_alarms = lambda alarms: loop.call_soon_threadsafe(tell, alarms)

    def _told_after(self, work: Callable[[], T]) -> T:
        try:
            return work()
        finally:
            if self.alarms is not self._told and self._tell_alarms is not None:
                self._told = self.alarms
                self._tell_alarms(self._told)

    def _store_model(self) -> None:
        """Write the model beside the captures it was used on: the discrepancy workflow starts from it."""
        self._journal_writer.store_model(MODEL.dumps(self._design.model))

    def _fit_state(self) -> None:
        """Make the state fit the design; what that costs is told, here and by the signature's quality."""
        state = self._state
        fitted = core.migrate_state(self._design, state, time.time_ns())
        if fitted.signature is not state.signature:
            self.log.warning("the grid of the signature was changed: the signature is learned anew")
        if fitted.tracker is not state.tracker:
            is_guess = self._design.model.is_provisional
            what = "a provisional model is in service" if is_guess else "the provisional model was replaced"
            self.log.warning("%s: wear and batches are learned anew", what)
        if fitted.alarms is not state.alarms:
            self._record(fitted)
        self._state = fitted

    def _process(self, capture: Capture, step: Callable[[], StepResult]) -> StepResult:
        step_result = step()
        state, snapshot = step_result.state, step_result.snapshot
        last = CycleId(capture.session, capture.cycle)
        is_kept = self._journal_writer.journal is not None
        blob = self._blob(state, snapshot, last) if is_kept else b""
        self.last, self._state, self._snapshot = last, state, snapshot
        if is_kept:
            changed = step_result.changed
            self._journal_writer.cycle(last, lambda journal: journal.append(capture, snapshot, blob, changed))
        return step_result

    def _maintain(self, time_ns: int) -> None:
        try:
            active = [alarm for alarm in self.alarms if alarm.active]
            times_ns = {time_ns for alarm in active for time_ns in (alarm.activation, alarm.time_ns)}
            self._journal_writer.maintain(time_ns, times_ns)
        except Exception:
            self.log.exception("the journal could not be tidied")

    def _blob(self, state: CellState, snapshot: Snapshot | None, last: CycleId | None) -> bytes:
        stored = StoredState(state, snapshot, self.belief, last, self.handled_target)
        return pack_state(stored, self._unknown)

    def _apply_rule_result(self, rule_result: RuleResult, time_ns: int) -> None:
        state, changed = core.apply_rule_result(self._design, self._state, rule_result, time_ns)
        if changed:
            self._record(state)
        else:
            self._state = state

    def _expire_shelving(self, time_ns: int) -> None:
        state, changed = core.expire_shelving(self._state, time_ns)
        if changed:
            self._record(state)

    def _apply_event(self, name: str, event: AlarmEvent, audit: AuditEntry) -> Transition:
        state, transition = core.apply_event(self._state, name, event)
        audit = replace(audit, result="Good" if transition.refusal is None else transition.refusal.value)
        self._record(state, audit)
        return transition

    def _record(self, state: CellState, audit: AuditEntry | None = None) -> None:
        """Take a state and store it; one that cannot be written is not taken, for no later one could be."""
        pairs = zip(self.alarms, state.alarms.alarms, strict=True)
        changed = tuple(after for before, after in pairs if after is not before)
        blob = self._blob(state, self._snapshot, self.last)
        self._state = state
        self._journal_writer.store(lambda journal: journal.record(blob, changed, audit))
