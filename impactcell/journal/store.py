"""The durable store of one cell: what has been committed here survives a crash, a power cut included.

Write-ahead log with full synchronisation. A cycle, its capture, its alarms and the state that it led to
are one transaction: after any crash the file shows the cycle with all of it, or not at all.

A `Journal` is used from one thread at a time; `impactcell.service.worker` gives it a thread of its own.
"""

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Self

from impactcell.errors import JournalError
from impactcell.journal import salvage
from impactcell.journal.audit_entries import AuditEntry, stored_audit
from impactcell.journal.capture_codec import encode_capture
from impactcell.journal.checksums import CheckedTables
from impactcell.journal.database import Upgrade, check_name, errors, open_database, set_aside
from impactcell.journal.history import HistoryQuery, Page, StoredValue, stored_alarms, stored_values
from impactcell.journal.lock import kept_lock, lock_journal
from impactcell.journal.presence import FilePresence
from impactcell.journal.retention import Retention, borne_out_ns, prune
from impactcell.journal.schema import cycle_row
from impactcell.journal.stored_forms import ALARM, load_alarms
from impactcell.records import Alarm, Capture, CycleId, Snapshot


class Journal:
    """One cell's journal file.

    Parameters
    ----------
    path : Path
        Created where it does not exist.
    cell : str
        The journal of another cell is refused.
    read_only : bool
        Open an existing file without writing to it.
    upgrade : callable, optional
        Gives a state that an earlier version stored as this one does, as `upgraded_state` of
        `impactcell.journal.stored_forms`; see `impactcell.journal.database.open_database`.

    Raises
    ------
    ForeignJournalError
        If the file is not a journal, of another format, or of another cell; it is left as it is.
    JournalUnavailableError
        If the file cannot be opened now.
    JournalDamagedError
        If it is damaged: once it is put aside, another can be begun at its path.
    JournalError
        If somebody has to act first: another service writes it, or it has two names.
    """

    def __init__(
        self, path: Path, cell: str | None, *, read_only: bool = False, upgrade: Upgrade | None = None
    ) -> None:
        self.path = path
        with errors(self.path):
            check_name(path)
            if read_only and not path.is_file():
                raise JournalError(f"{path}: there is no such journal")
            self._lock = None if read_only else lock_journal(path)
        self._open_database = partial(open_database, path, cell, read_only=read_only, upgrade=upgrade)
        try:
            self._open()
        except BaseException:
            if self._lock is not None:
                self._lock.close()
            raise

    def _open(self) -> None:
        self._db = self._open_database()
        self._presence = FilePresence(self.path)
        with errors(self.path):
            self._presence.check()
            self._tables = CheckedTables(self._db, self.path)
        self._last_stored: CycleId | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; what was committed stays."""
        self._db.close()
        if self._lock is not None:
            self._lock.close()

    def begin_anew(self, *, damaged: bool) -> Path | None:
        """Open what is at the path, a new file where there is none; what is damaged gets another name first.

        For a journal whose file was removed or replaced, or that is damaged.

        Returns
        -------
        Path or None
            Where the damaged file is now.

        Raises
        ------
        JournalError
            As on opening; the next call tries again.
        """
        self._db.close()
        aside = None
        with errors(self.path):
            if damaged and self.path.exists():
                aside = set_aside(self.path)
        self._open()
        return aside

    @property
    def cell(self) -> str:
        """Name of the cell this journal belongs to."""
        return self.meta("cell")

    @property
    def model(self) -> str:
        """Model the recording cell runs with, as JSON; empty before the first."""
        return self.meta("model")

    def store_model(self, model: str) -> None:
        """Keep the model that the cell runs with from now on."""
        self.store_meta("model", model)

    def store_meta(self, key: str, value: str) -> None:
        """Keep something that is known of the cell or its module."""
        with self._transaction():
            self._tables.insert("meta", {"key": key, "value": value})

    def meta(self, key: str) -> str:
        """Return what `store_meta` keeps; empty where there is nothing."""
        with errors(self.path):
            rows = self._tables.rows("meta", "SELECT * FROM meta WHERE key = ?", key)
            return str(rows[0]["value"]) if rows else ""

    def append(
        self, capture: Capture, snapshot: Snapshot, state: bytes, changed: Sequence[Alarm] = ()
    ) -> None:
        """Store one cycle, its capture, the alarms it changed and the state it led to, all or nothing.

        Raises
        ------
        JournalUnavailableError
            If it cannot be written now, JournalFullError if for lack of room; nothing of the cycle is stored.
        JournalGoneError
            If the file is no longer there; nothing counts as stored.
        JournalError
            If the cycle is stored already, or the file cannot be written.
        """
        cycle_id = CycleId(capture.session, capture.cycle)
        with self._transaction():
            if cycle_id == self.last_cycle_id():
                raise JournalError(f"{self.path}: cycle {capture.cycle} is stored already")
            row = self._tables.insert("cycles", cycle_row(capture, snapshot))
            self._db.execute("INSERT INTO captures VALUES (?, ?)", (row, encode_capture(capture)))
            self._put_alarms(changed)
            self._tables.insert("state", {"id": 1, "seq": row, "blob": state})
        self._last_stored = cycle_id

    def record(self, state: bytes, changed: Sequence[Alarm] = (), audit: AuditEntry | None = None) -> None:
        """Store what happened between cycles: alarms, a person's action and the state they led to."""
        with self._transaction():
            self._put_alarms(changed)
            if audit is not None:
                self._tables.insert("audit", asdict(audit))
            (row,) = self._db.execute("SELECT coalesce(max(seq), 0) FROM cycles").fetchone()
            self._tables.insert("state", {"id": 1, "seq": row, "blob": state})

    def state(self) -> bytes | None:
        """Return the state of the last durable cycle; None in a new journal.

        Raises
        ------
        JournalDamagedError
            If it is not what was written.
        """
        return self._blob("state")

    def state_backup(self) -> bytes | None:
        """Return the state as `back_up_state` kept it; None where it never did. Raises as `state` does."""
        return self._blob("state_backup")

    def back_up_state(self) -> None:
        """Keep a second copy of the state, for the case that the first is damaged one day."""
        with self._transaction():
            self._db.execute("INSERT OR REPLACE INTO state_backup SELECT 1, blob, crc FROM state")

    def last_cycle_id(self) -> CycleId | None:
        """Return the last durable cycle; None in a new journal.

        Of a damaged row its capture tells which cycle it was; without a whole one the row does not count.
        """
        if self._last_stored is None:
            with errors(self.path):
                self._last_stored = salvage.last_cycle_id(self._db, self._tables)
        return self._last_stored

    def last_of_sessions(self) -> list[tuple[CycleId, int]]:
        """Return the last cycle of each session that came lately, and its time; see `journal.salvage`."""
        with errors(self.path):
            return salvage.last_of_sessions(self._db, self._tables)

    def captures(
        self,
        first_cycle: int | None = None,
        last_cycle: int | None = None,
        damaged: Callable[[str], None] | None = None,
        newest: int | None = None,
    ) -> Iterator[Capture]:
        """Yield the stored captures in order of their cycles; those that were dropped are gone.

        Their batch is the one that the cell took each for: the module's, or what a person said in its place.

        Parameters
        ----------
        first_cycle, last_cycle : int or None
            Both included.
        damaged : callable, optional
            Told of each capture that cannot be read, by its cycle; the others follow.
        newest : int, optional
            Only of the last so many.

        Raises
        ------
        JournalDamagedError
            At the first that cannot be read, without `damaged`.
        """
        with errors(self.path):
            first, last = first_cycle or 0, math.inf if last_cycle is None else last_cycle
            wanted = (
                each for each in salvage.stored_captures(self._db, newest) if first <= each.cycle <= last
            )
            yield from salvage.decoded_captures(wanted, self.path, damaged)

    def values(self, variable: str, query: HistoryQuery) -> Page[StoredValue]:
        """Return stored values of a variable; see `impactcell.journal.history`."""
        with errors(self.path):
            return stored_values(self._db, variable, query, self._tables.is_whole)

    def alarms(self, query: HistoryQuery) -> Page[Alarm]:
        """Return the states that each transition of an alarm led to."""
        with errors(self.path):
            page = stored_alarms(self._db, query, self._tables.is_whole)
        return Page(load_alarms(page.entries), page.resume)

    def checkpoint(self) -> None:
        """Move what has been committed from the log into the file; it is as durable before as after."""
        with errors(self.path):
            self._db.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchall()

    def prune(self, keep: Retention, now_ns: int, active_ns: Collection[int] = ()) -> bool:
        """Drop what `keep` does not keep, and say if there is more; see `impactcell.journal.retention`."""
        with errors(self.path):
            return prune(self._db, keep, now_ns, active_ns)

    def borne_out_ns(self, now_ns: int) -> int:
        """Give the latest time that the cycles bear out; see `impactcell.journal.retention`."""
        with errors(self.path):
            return borne_out_ns(self._db, now_ns)

    def count(self) -> int:
        """Return how many cycles the journal holds."""
        with errors(self.path):
            return int(self._db.execute("SELECT count(*) FROM cycles").fetchone()[0])

    def audit(self) -> tuple[AuditEntry, ...]:
        """Return every action of a person, oldest first."""
        with errors(self.path):
            return stored_audit(self._db, self._tables)

    def _blob(self, table: str) -> bytes | None:
        with errors(self.path):
            rows = self._tables.rows(table, f"SELECT * FROM {table}")  # noqa: S608 - from above
        return bytes(rows[0]["blob"]) if rows else None

    def _put_alarms(self, changed: Sequence[Alarm]) -> None:
        for alarm in changed:
            self._tables.insert("alarms", {"time_ns": alarm.time_ns, "record": ALARM.dumps(alarm)})

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        with errors(self.path):
            self._lock = self._lock and kept_lock(self._lock, self.path)
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._db.execute("COMMIT")
            except BaseException:
                if self._db.in_transaction:
                    self._db.execute("ROLLBACK")
                raise
            self._presence.check()
