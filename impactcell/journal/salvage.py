"""What can still be read of a damaged journal: its state, and captures one by one."""

import contextlib
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from impactcell.errors import JournalDamagedError, JournalError
from impactcell.journal.capture_codec import decode_capture
from impactcell.journal.checksums import CheckedTables
from impactcell.records import Capture, CycleId

RECENT: Final = 2**16
"""Cycles that are looked through for sessions of before: a tenth of a second."""
_NEXT = "SELECT seq, blob FROM captures WHERE seq >= ? ORDER BY seq LIMIT 1"
_ONE = "SELECT blob FROM captures WHERE seq = ?"


@dataclass(frozen=True, slots=True)
class StoredCapture:
    """A capture as it is stored.

    Attributes
    ----------
    seq : int
        Its place in the journal.
    cycle : int
        Number of its cycle; 0 where that cannot be read.
    batch_id : str
        Batch that the cell took it for, which a person may have named; empty without one.
    blob : bytes or None
        None where it cannot be read.
    """

    seq: int
    cycle: int
    batch_id: str
    blob: bytes | None


def stored_captures(database: sqlite3.Connection, newest: int | None = None) -> Iterator[StoredCapture]:
    """Yield all captures in their order; after a page that cannot be read it goes on behind it.

    Parameters
    ----------
    newest : int, optional
        Only the last so many.

    Raises
    ------
    sqlite3.DatabaseError
        If not even the last one can be found.
    """
    last = _last(database)
    seq = 1 if newest is None else max(last - newest + 1, 1)
    while seq <= last:
        try:
            row = database.execute(_NEXT, (seq,)).fetchone()
        except sqlite3.DatabaseError:
            row = None
            stored = _one(database, seq)
            if stored is not None:
                yield stored
        else:
            if row is None:
                return
            seq = row[0]
            yield StoredCapture(seq, *_cycle(database, seq), bytes(row[1]))
        seq += 1


def last_cycle_id(database: sqlite3.Connection, tables: CheckedTables) -> CycleId | None:
    """Give the last cycle stored; of a damaged row its capture tells which it was, if that is whole."""
    for row in database.execute("SELECT * FROM cycles ORDER BY seq DESC"):
        values = dict(zip(tables.columns["cycles"], row, strict=True))
        if tables.is_whole("cycles", row):
            return CycleId(values["session"], values["cycle"])
        stored = _one(database, values["seq"])
        with contextlib.suppress(JournalError):
            capture = decode_capture(None if stored is None else stored.blob)
            return CycleId(capture.session, capture.cycle)
    return None


def last_of_sessions(database: sqlite3.Connection, tables: CheckedTables) -> list[tuple[CycleId, int]]:
    """Give the last cycle of each session among the last `RECENT`, and its time, in their order."""
    query = (
        "SELECT * FROM cycles WHERE seq IN (SELECT max(seq) FROM cycles "
        "WHERE seq > (SELECT max(seq) FROM cycles) - ? GROUP BY session) ORDER BY seq"
    )
    whole = (row for row in database.execute(query, (RECENT,)) if tables.is_whole("cycles", row))
    named = (dict(zip(tables.columns["cycles"], row, strict=True)) for row in whole)
    return [(CycleId(row["session"], row["cycle"]), row["time_ns"]) for row in named]


def decoded_captures(
    stored_captures: Iterable[StoredCapture], path: Path, damaged: Callable[[str], None] | None
) -> Iterator[Capture]:
    """Yield captures with the batch that the cell took each for.

    Parameters
    ----------
    stored_captures : iterable of StoredCapture
    path : Path
        Of their journal, for messages.
    damaged : callable, optional
        Told of each that cannot be read, by its cycle; the others follow.

    Raises
    ------
    JournalDamagedError
        At the first that cannot be read, without `damaged`.
    """
    for stored in stored_captures:
        try:
            capture = decode_capture(stored.blob)
            yield replace(capture, batch_id=stored.batch_id or capture.batch_id)
        except JournalDamagedError as error:
            name = f"cycle {stored.cycle}" if stored.cycle else f"the {stored.seq}th cycle"
            if damaged is None:
                raise JournalDamagedError(f"{path}: {name}: {error}") from error
            damaged(f"{name}: {error}")


def salvaged_state(path: Path) -> bytes | None:
    """Read the state of a journal that cannot be opened as one; None where that, too, is damaged."""
    try:
        with contextlib.closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as database:
            tables = CheckedTables(database, path)
            for table in ("state", "state_backup"):
                with contextlib.suppress(sqlite3.DatabaseError, JournalDamagedError):
                    for row in tables.rows(table, f"SELECT * FROM {table}"):  # noqa: S608 - from above
                        return bytes(row["blob"])
    except sqlite3.DatabaseError:
        return None
    return None


def _one(database: sqlite3.Connection, seq: int) -> StoredCapture | None:
    """Give the capture in this place; None where there is none, without a blob where it cannot be read."""
    try:
        row = database.execute(_ONE, (seq,)).fetchone()
    except sqlite3.DatabaseError:
        return StoredCapture(seq, *_cycle(database, seq), None)
    return None if row is None else StoredCapture(seq, *_cycle(database, seq), bytes(row[0]))


def _cycle(database: sqlite3.Connection, seq: int) -> tuple[int, str]:
    """Give number and batch of the cycle in this place; 0 and none where it cannot be read."""
    try:
        row = database.execute("SELECT cycle, batch_id FROM cycles WHERE seq = ?", (seq,)).fetchone()
    except sqlite3.DatabaseError:
        row = None
    return (0, "") if row is None else (int(row[0]), row[1] or "")


def _last(database: sqlite3.Connection) -> int:
    found: list[int] = []
    error: sqlite3.DatabaseError | None = None
    for table in ("cycles", "captures"):
        try:
            row = database.execute(f"SELECT max(seq) FROM {table}").fetchone()  # noqa: S608 - from above
        except sqlite3.DatabaseError as fault:
            error = fault
        else:
            found.append(row[0] or 0)
    if error is not None and not found:
        raise error
    return max(found)
