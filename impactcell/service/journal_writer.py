"""What a cell wants kept, written in order; it waits in memory while the journal cannot be written."""

import logging
import time
from collections import deque
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Final

from impactcell.errors import JournalDamagedError, JournalError, JournalGoneError
from impactcell.fieldbus.cycles.taken_cycles import NOTHING_BEFORE, TakenBefore
from impactcell.journal.database import set_aside
from impactcell.journal.retention import NS_PER_DAY, SETTLED_NS, Retention
from impactcell.journal.salvage import salvaged_state
from impactcell.journal.store import Journal
from impactcell.journal.stored_forms import upgraded_state
from impactcell.process.cell_logger import CellLogger
from impactcell.records import CycleId

BACKLOG = 64
"""Entries kept in memory while the journal cannot be written."""
CHECKPOINT_EVERY = 24
"""Cycles after which the journal's log goes into its file: before SQLite, at 1000 pages, would make a cycle
wait for that."""
PRUNE_EVERY = 256
"""Cycles between two looks at what the journal may drop."""
AHEAD_NS = 7 * NS_PER_DAY
"""A clock further ahead of the cycles before is told, nanoseconds; a machine may stand over a holiday."""
_SERIAL = "serial_number"
"""Under what a journal keeps which module made its last cycle."""

Entry = Callable[[Journal], None]
_READ_AGAIN: Final = (
    "cycles among them are read again when the service is started next, as far as the module's ring still "
    "has them: put that right, and start it"
)
"""What becomes of what could not be stored: no module is told that it may forget what is not durable."""


def open_journal(path: Path, cell: str) -> tuple[Journal, str]:
    """Open a cell's journal; one that is damaged is put aside, and a new one goes on from its state.

    Returns
    -------
    Journal
    str
        What a person has to know of it; empty where all is well.

    Raises
    ------
    ForeignJournalError, JournalUnavailableError, JournalError
        As `Journal` does.
    """
    try:
        return Journal(path, cell, upgrade=upgraded_state), ""
    except JournalDamagedError as error:
        aside = set_aside(path)
        state, why = salvaged_state(aside), str(error)
    journal = Journal(path, cell, upgrade=upgraded_state)
    event = f"{why}; it was put aside as {aside.name}, and a new one is begun"
    if state is None:
        return journal, f"{event}: wear, batch, signature, and what positioning has learned, begin anew"
    journal.record(state)
    return journal, f"{event} with its state"


class JournalWriter:
    """Writes a cell's entries into its journal; used from the cell's thread only.

    Parameters
    ----------
    cell : str
    journal : Journal or None
        None keeps nothing over a restart.
    keep : Retention

    Attributes
    ----------
    fault : str
        Why something was not stored, or is not yet; empty while all is.
    """

    def __init__(self, cell: str, journal: Journal | None, keep: Retention) -> None:
        self.journal = journal
        self.fault = ""
        self.durable: CycleId | None = None
        """The last cycle that is safely stored; None where there is none."""
        self.lost = 0
        """Cycles that were never stored; an acknowledgement of a later one covers them."""
        self.serial_number = ""
        """Of the module that made the last cycle; empty where that is not known."""
        self._events: list[str] = []
        self._keep = keep
        self._log = CellLogger(logging.getLogger(__name__), cell)
        self._waiting: deque[tuple[CycleId | None, Entry]] = deque()
        self._model = ""
        self._broken: JournalError | None = None
        self._saved: CycleId | None = None
        """Last cycle of a journal begun anew: what was written last may be in it after all, by its log."""
        self._since_pruned, self._since_checkpoint = PRUNE_EVERY, CHECKPOINT_EVERY
        self._said_ahead = False
        if journal is not None:
            try:
                self.durable = journal.last_cycle_id()
            except JournalDamagedError as error:
                self._broken = error
                self.report(str(error))

    def report(self, event: str) -> None:
        """Say that something happened to the journal which a person has to know of, also if it is over."""
        self._log.error("%s", event)
        self.fault = event
        self._events.append(event)

    def take_events(self) -> list[str]:
        """Return what happened since the last call."""
        events, self._events = self._events, []
        return events

    @property
    def has_backlog(self) -> bool:
        """Whether something could not be written yet."""
        return bool(self._waiting)

    @property
    def maintenance_due(self) -> bool:
        """Whether `maintain` is due."""
        return self.journal is not None and self._since_checkpoint >= CHECKPOINT_EVERY and not self._waiting

    def store_model(self, model: str) -> None:
        """Write the model that the cell runs with; a journal that is begun anew gets it first."""
        self._model = model
        self.store(lambda journal: journal.store_model(model))

    def taken_before(self) -> TakenBefore:
        """Give what the journal knows of what was taken before; nothing where it cannot be read."""
        if self.journal is None:
            return NOTHING_BEFORE
        try:
            self.serial_number = self.journal.meta(_SERIAL)
            return TakenBefore(self.journal.last_of_sessions(), self.serial_number)
        except JournalError as error:
            self._log.warning("cycles of sessions before the last one may come twice: %s", error)
            return NOTHING_BEFORE

    def store_serial_number(self, serial_number: str) -> None:
        """Write which module the cell reads; a journal that is begun anew gets it, too."""
        self.serial_number = serial_number
        self.store(lambda journal: journal.store_meta(_SERIAL, serial_number))

    def cycle(self, cycle_id: CycleId, entry: Entry) -> None:
        """Write a cycle."""
        self._since_pruned += 1
        self._since_checkpoint += 1
        self.store(entry, cycle_id)

    def maintain(self, time_ns: int, active_ns: Collection[int] = ()) -> None:
        """Do what no cycle has to wait for: empty the log, and drop what has become too old or too much.

        Parameters
        ----------
        time_ns : int
            Of the last cycle.
        active_ns : collection of int
            Times of transitions of alarms that are active, which stay.
        """
        if self.journal is None:
            return
        self._since_checkpoint = 0
        now_ns = time.time_ns()
        try:
            if self._since_pruned >= PRUNE_EVERY:
                self._since_pruned = 0
                # A module's clock that runs ahead must not make everything look old; 0 is no time at all.
                self.journal.back_up_state()
                now_ns = self._borne_out_ns(self.journal, min(time_ns or now_ns, now_ns))
                if self.journal.prune(self._keep, now_ns, active_ns):
                    self._since_pruned = PRUNE_EVERY
            else:
                self.journal.checkpoint()
        except (JournalGoneError, JournalDamagedError) as error:
            self._broken = error
            self.report(str(error))
        except JournalError as error:
            self.fault = str(error)

    def _borne_out_ns(self, journal: Journal, now_ns: int) -> int:
        """Give the time by which what is stored is old, and say once where the clock is far ahead of it."""
        borne_out_ns = journal.borne_out_ns(now_ns)
        is_ahead = now_ns - borne_out_ns > AHEAD_NS
        if is_ahead and not self._said_ahead:
            self._log.warning(
                "the last cycle is dated over %d days after those before: unless the machine stood so long, "
                "set the clock right; nothing is dropped for it before cycles have come for %g h",
                (now_ns - borne_out_ns) // NS_PER_DAY, SETTLED_NS / 3.6e12,
            )  # fmt: skip
        self._said_ahead = is_ahead
        return borne_out_ns

    def store(self, entry: Entry, cycle_id: CycleId | None = None) -> None:
        """Write `entry` after all that could not be written before: no state may be ahead of its cycles."""
        if self.journal is None:
            return
        self._waiting.append((cycle_id, entry))
        if len(self._waiting) > BACKLOG:
            self._drop("the journal cannot be written, and no more can wait for it")
        self.retry()

    def _drop(self, why: str) -> None:
        """Give up the entry that has waited longest."""
        cycle_id, _ = self._waiting.popleft()
        if cycle_id is None:
            self._log.error("an entry of the journal is lost: %s", why)
        elif cycle_id != self.durable:  # else it is stored already
            self.lost += 1
            self._log.error("not stored, and lost: %s", why, cycle=cycle_id.cycle)

    def retry(self) -> None:
        """Write what waits, as far as the journal takes it."""
        fault = ""
        while self._waiting and self.journal is not None:
            try:
                if self._broken is not None:
                    self._begin_anew(self.journal, damaged=isinstance(self._broken, JournalDamagedError))
                cycle_id, entry = self._waiting[0]
                if cycle_id is None or cycle_id != self._saved:
                    entry(self.journal)
                self.durable = cycle_id or self.durable
            except (JournalGoneError, JournalDamagedError) as error:
                self._broken = self._broken or error
                self.report(str(error))
                return
            except JournalError as error:
                if error.retry:
                    self.fault = str(error)
                    return
                # What can never be stored must not keep what can from being stored.
                fault = str(error)
                self._drop(fault)
            else:
                self._waiting.popleft()
        self.fault = fault

    def _begin_anew(self, journal: Journal, *, damaged: bool) -> None:
        try:
            aside = journal.begin_anew(damaged=damaged)
            journal.store_model(self._model)
            if self.serial_number:
                journal.store_meta(_SERIAL, self.serial_number)
        except JournalError as error:
            raise JournalGoneError(f"{journal.path}: cannot be begun anew: {error}") from error
        self._broken = None
        self.durable = journal.last_cycle_id()
        self._saved = self.durable
        self.report(
            f"{journal.path}: the journal is begun anew"
            + (f"; what is damaged was put aside as {aside.name}" if aside is not None else "")
        )

    def close(self) -> int:
        """Close the journal, after a last attempt to write what waits.

        Returns
        -------
        int
            How many entries cannot be written, and are lost.
        """
        if self.journal is None:
            return 0
        self.retry()
        if self._waiting:
            self._log.error(
                "entries of the journal lost at the end of the service: %d; %s; %s",
                len(self._waiting),
                self.fault,
                _READ_AGAIN,
            )
        self.journal.close()
        name = self.journal.path.name
        log = self.journal.path.with_name(f"{name}-wal")
        if log.exists() and log.stat().st_size:
            self._log.warning(
                "%s could not be emptied into %s: the disk is full, or another program has the file open. "
                "What is stored is in both: to copy the journal, copy %s and %s together",
                log, name, name, log.name,
            )  # fmt: skip
        return len(self._waiting)
