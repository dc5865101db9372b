"""The durable store of one cell: what has been committed here survives a crash, a power cut included.

Write-ahead log with full synchronisation. A cycle, its capture, its alarms and the state that it led to
are one transaction: after any crash the file shows the cycle with all of it, or not at all.

A `Journal` is used from one thread at a time; `impactcell.service.worker` gives it a thread of its own.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Self

from impactcell.errors import JournalError
from impactcell.journal.capture_codec import decode_capture, encode_capture
from impactcell.journal.database import Upgrade, errors, open_database
from impactcell.journal.history import HistoryQuery, Page, StoredValue, stored_alarms, stored_values
from impactcell.journal.lock import lock_journal
from impactcell.journal.presence import FilePresence
from impactcell.journal.retention import Retention, prune
from impactcell.journal.schema import COLUMNS
from impactcell.journal.stored_forms import ALARM
from impactcell.records import Alarm, Capture, CycleId, Snapshot

_INSERT_CYCLE = (
    f"INSERT INTO cycles ({', '.join(c.name for c in COLUMNS)}) VALUES ({', '.join('?' * len(COLUMNS))})"  # noqa: S608
)


@dataclass(frozen=True, slots=True)
class AuditEntry:
    """Who did what, when, and what came of it."""

    time_ns: int
    user: str
    action: str
    arguments: str
    result: str


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
    JournalFullError
        If the file cannot be opened now.
    JournalError
        If it never can: another service writes it, or it is damaged.
    """

    def __init__(
        self, path: Path, cell: str | None, *, read_only: bool = False, upgrade: Upgrade | None = None
    ) -> None:
        self.path = path
        self._last_stored: CycleId | None = None
        with self._errors():
            if read_only and not path.is_file():
                raise JournalError(f"{path}: there is no such journal")
            self._lock = None if read_only else lock_journal(path)
        self._open = partial(open_database, path, cell, read_only=read_only, upgrade=upgrade)
        try:
            self._db = self._open()
        except BaseException:
            if self._lock is not None:
                self._lock.close()
            raise
        self._presence = FilePresence(path)
        self._presence.check()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; what was committed stays."""
        self._db.close()
        if self._lock is not None:
            self._lock.close()

    def begin_anew(self) -> None:
        """Open what is at the path now, after a `JournalGoneError`: a file that was put back, or a new one.

        Raises
        ------
        JournalError
            As on opening; the next call tries again.
        """
        self._db.close()
        self._db = self._open()
        self._last_stored = None
        self._presence = FilePresence(self.path)
        self._presence.check()

    @property
    def cell(self) -> str:
        """Name of the cell this journal belongs to."""
        return self._meta("cell")

    @property
    def model(self) -> str:
        """Model the recording cell runs with, as JSON; empty before the first."""
        return self._meta("model")

    def store_model(self, model: str) -> None:
        """Keep the model that the cell runs with from now on."""
        with self._transaction():
            self._db.execute("INSERT OR REPLACE INTO meta VALUES ('model', ?)", (model,))

    def append(
        self, capture: Capture, snapshot: Snapshot, state: bytes, changed: Sequence[Alarm] = ()
    ) -> None:
        """Store one cycle, its capture, the alarms it changed and the state it led to, all or nothing.

        Raises
        ------
        JournalFullError
            If the disk or a quota is full; nothing of the cycle is stored.
        JournalGoneError
            If the file is no longer there; nothing counts as stored.
        JournalError
            If the cycle is stored already, or the file cannot be written.
        """
        cycle_id = CycleId(capture.session, capture.cycle)
        with self._transaction():
            if cycle_id == self.last_cycle_id():
                raise JournalError(f"{self.path}: cycle {capture.cycle} is stored already")
            row = self._db.execute(
                _INSERT_CYCLE, [_sql(column.of(capture, snapshot)) for column in COLUMNS]
            ).lastrowid
            self._db.execute("INSERT INTO captures VALUES (?, ?)", (row, encode_capture(capture)))
            self._put_alarms(changed)
            self._db.execute("INSERT OR REPLACE INTO state VALUES (1, ?, ?)", (row, state))
        self._last_stored = cycle_id

    def record(self, state: bytes, changed: Sequence[Alarm] = (), audit: AuditEntry | None = None) -> None:
        """Store what happened between cycles: alarms, a person's action and the state they led to."""
        with self._transaction():
            self._put_alarms(changed)
            if audit is not None:
                self._db.execute(
                    "INSERT INTO audit (time_ns, user, action, arguments, result) VALUES (?, ?, ?, ?, ?)",
                    (audit.time_ns, audit.user, audit.action, audit.arguments, audit.result),
                )
            self._db.execute(
                "INSERT OR REPLACE INTO state VALUES (1, (SELECT coalesce(max(seq), 0) FROM cycles), ?)",
                (state,),
            )

    def state(self) -> bytes | None:
        """Return the state of the last durable cycle; None in a new journal."""
        with self._errors():
            row = self._db.execute("SELECT blob FROM state").fetchone()
        return None if row is None else bytes(row[0])

    def last_cycle_id(self) -> CycleId | None:
        """Return the last durable cycle; None in a new journal."""
        if self._last_stored is not None:
            return self._last_stored
        with self._errors():
            row = self._db.execute("SELECT session, cycle FROM cycles ORDER BY seq DESC LIMIT 1").fetchone()
        return None if row is None else CycleId(*row)

    def captures(self, first_cycle: int | None = None, last_cycle: int | None = None) -> Iterator[Capture]:
        """Yield the stored captures in order of their cycles; thinned ones are gone."""
        with self._errors():
            rows = self._db.execute(
                "SELECT blob FROM captures JOIN cycles USING (seq) "
                "WHERE (?1 IS NULL OR cycle >= ?1) AND (?2 IS NULL OR cycle <= ?2) ORDER BY seq",
                (first_cycle, last_cycle),
            )
            for (blob,) in rows:
                yield decode_capture(blob)

    def values(self, variable: str, query: HistoryQuery) -> Page[StoredValue]:
        """Return stored values of a variable; see `impactcell.journal.history`."""
        with self._errors():
            return stored_values(self._db, variable, query)

    def alarms(self, query: HistoryQuery) -> Page[Alarm]:
        """Return the states that each transition of an alarm led to."""
        with self._errors():
            return stored_alarms(self._db, query)

    def checkpoint(self) -> None:
        """Move what has been committed from the log into the file; it is as durable before as after."""
        with self._errors():
            self._db.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchall()

    def prune(self, keep: Retention, now_ns: int) -> bool:
        """Drop what `keep` does not keep, and say if there is more; see `impactcell.journal.retention`."""
        with self._errors():
            return prune(self._db, keep, now_ns)

    def count(self) -> int:
        """Return how many cycles the journal holds."""
        with self._errors():
            return int(self._db.execute("SELECT count(*) FROM cycles").fetchone()[0])

    def audit(self) -> tuple[AuditEntry, ...]:
        """Return every action of a person, oldest first."""
        with self._errors():
            rows = self._db.execute("SELECT time_ns, user, action, arguments, result FROM audit ORDER BY id")
            return tuple(AuditEntry(*row) for row in rows)

    def _meta(self, key: str) -> str:
        with self._errors():
            row = self._db.execute("SELECT value FROM meta WHERE key = ?", (key,)).fetchone()
        return "" if row is None else str(row[0])

    def _put_alarms(self, changed: Sequence[Alarm]) -> None:
        self._db.executemany(
            "INSERT INTO alarms (time_ns, record) VALUES (?, ?)",
            [(alarm.time_ns, ALARM.dumps(alarm)) for alarm in changed],
        )

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        with self._errors():
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._db.execute("COMMIT")
            except BaseException:
                if self._db.in_transaction:
                    self._db.execute("ROLLBACK")
                raise
            self._presence.check()

    def _errors(self) -> AbstractContextManager[None]:
        return errors(self.path)


def _sql(value: float | str) -> float | str | None:
    """NaN is no SQL number: it is stored as NULL."""
    return None if isinstance(value, float) and math.isnan(value) else value
