"""The journal's file: opened, checked to be ours, and its errors by name."""

import contextlib
import errno
import os
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Final

from impactcell.errors import (
    ForeignJournalError,
    JournalDamagedError,
    JournalError,
    JournalFullError,
    JournalUnavailableError,
)
from impactcell.journal.checksums import row_crc
from impactcell.journal.presence import check_writable
from impactcell.journal.schema import APPLICATION_ID, COLUMNS, FORMAT, OLDEST, TABLES, UPGRADES

WAY_OUT: Final = "run the version that wrote it, or name another file to begin anew"
ANOTHER: Final = "it is left as it is; name another file"
_NO_ROOM: Final = (errno.ENOSPC, errno.EDQUOT)
_DAMAGED: Final = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)
_HELD: Final = (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED)
WRITE_PATIENCE_S: Final = 0.05
"""How long a write waits for another program's to end, seconds: no cell is to stand still for it, and what
cannot be written is tried again."""
_MAGIC: Final = b"SQLite format 3\0"
_APPLICATION_ID_AT: Final = 68
"""Where a database's header has it (The SQLite Database File Format, section 1.3)."""

Upgrade = Callable[[bytes], bytes | None]


@contextmanager
def errors(path: Path) -> Iterator[None]:
    """Turn the errors of SQLite and of the system into ours, which say whether trying again can help."""
    try:
        yield
    except OSError as error:
        raise _temporary_error(path, error.strerror, full=error.errno in _NO_ROOM) from error
    except sqlite3.OperationalError as error:
        code = _code(error)
        if code == sqlite3.SQLITE_ERROR:  # a table is missing
            raise JournalError(f"{path}: cannot be used ({error}); name another file") from error
        if code == sqlite3.SQLITE_IOERR:
            raise _io_error(path, error) from error
        if code in _DAMAGED:
            raise JournalDamagedError(f"{path}: is damaged and cannot be used ({error})") from error
        if code in _HELD:
            raise JournalUnavailableError(
                f"{path}: another program has it open for writing ({error}); close it there"
            ) from error
        raise _temporary_error(path, error, full=code == sqlite3.SQLITE_FULL) from error
    except UnicodeDecodeError as error:  # SQLite quotes a schema that is damaged
        raise JournalDamagedError(f"{path}: is damaged and cannot be used (its text is no UTF-8)") from error
    except sqlite3.DatabaseError as error:
        if _code(error) in _DAMAGED:
            raise JournalDamagedError(f"{path}: is damaged and cannot be used ({error})") from error
        raise JournalError(f"{path}: cannot be used ({error})") from error
    except OverflowError as error:
        raise JournalError(f"{path}: cannot be used ({error})") from error


def _code(error: sqlite3.DatabaseError) -> int:
    """Primary result code; text that is no UTF-8 has none, and is damage."""
    return getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF


def _temporary_error(path: Path, reason: object, *, full: bool) -> JournalUnavailableError:
    """Make the error after which trying again can help."""
    if full:
        return JournalFullError(f"{path}: the disk or its quota is full ({reason}); make room")
    return JournalUnavailableError(
        f"{path}: cannot be used now ({reason}); check its disk, directory and owner"
    )


def _io_error(path: Path, error: sqlite3.OperationalError) -> JournalUnavailableError:
    """Say what SQLite's "disk I/O error" may be: it does not hand on what the system said."""
    with contextlib.suppress(OSError):
        if not os.statvfs(path.parent).f_bavail:
            return _temporary_error(path, error, full=True)
    return JournalUnavailableError(
        f"{path}: the disk failed ({error}, {error.sqlite_errorname}) though it is not full: its quota "
        "may be, or it is broken or gone; see the system's log"
    )


def check_name(path: Path) -> None:
    """Refuse what no file can be called; the system would not say which name it was.

    Raises
    ------
    JournalError
        The name holds what no name of a file can.
    """
    try:
        possible = b"\0" not in os.fsencode(path)
    except UnicodeEncodeError:
        possible = False
    if not possible:
        raise JournalError(f"{str(path)!r}: no file can have this name; name another")


def open_database(
    path: Path, cell: str | None, *, read_only: bool, upgrade: Upgrade | None = None
) -> sqlite3.Connection:
    """Open a journal's file, made anew where it is empty and may be written.

    A file of an earlier version that may be written is brought up to this one, in one transaction: whatever
    interrupts it leaves the file as it was.

    Parameters
    ----------
    upgrade : callable, optional
        Gives the stored state as this version writes it, None where it is so already, and a ValueError where
        it cannot be read; without it the state is left as it is.

    Raises
    ------
    ForeignJournalError
        The file is not a journal, of another format, or of another cell; it is left as it is.
    JournalUnavailableError
        It cannot be opened now.
    JournalError
        It is damaged.
    """
    with errors(path):
        if not read_only:
            check_header(path)
            check_writable(path)
        database = sqlite3.connect(
            f"{path.absolute().as_uri()}?{_read_only_query(path) if read_only else 'mode=rwc'}",
            uri=True,
            isolation_level=None,
            check_same_thread=False,
        )
    try:
        with errors(path):
            if _pages(database, path, read_only=read_only) == 0 and not read_only:
                _create(database, cell or "")
            _check(database, path, cell)
            if not read_only:
                database.execute("PRAGMA synchronous = FULL")
                # Debian's SQLite is built to write zeros over what is replaced: a whole state each cycle.
                database.execute("PRAGMA secure_delete = FAST")
                _upgrade_file(database, path, upgrade)  # what is refused is left as it is
                database.execute("PRAGMA journal_mode = WAL")
                database.execute(f"PRAGMA busy_timeout = {round(1e3 * WRITE_PATIENCE_S)}")
        database.text_factory = partial(str, encoding="utf-8", errors="replace")  # a checksum finds it out
    except BaseException:
        database.close()
        raise
    return database


def _pragma(database: sqlite3.Connection, name: str) -> int:
    return int(database.execute(f"PRAGMA {name}").fetchone()[0])


def _read_only_query(path: Path) -> str:
    """Give the query of the URI of a file that is only to be read.

    SQLite wants to write a little beside the file even then. On a read-only medium, where it cannot, and
    where nobody changes the file, it can do without, unless a log has what is not in the file yet.
    """
    logs = [path.with_name(path.name + suffix) for suffix in ("-wal", "-journal")]
    unfinished = any(log.exists() and log.stat().st_size for log in logs)
    fixed = os.statvfs(path).f_flag & os.ST_RDONLY and not unfinished
    return "mode=ro&immutable=1" if fixed else "mode=ro"


def _pages(database: sqlite3.Connection, path: Path, *, read_only: bool) -> int:
    """Count the pages, 0 in a new file; what no journal can be is found here, where a file is first read."""
    try:
        return _pragma(database, "page_count")
    except sqlite3.DatabaseError as error:
        code = _code(error)
        if code in _DAMAGED and not _is_ours(path):
            raise ForeignJournalError(f"{path}: not a journal ({error}); {ANOTHER}") from error
        if code == sqlite3.SQLITE_CANTOPEN and read_only:
            raise JournalError(
                f"{path}: cannot be read where it lies ({error}): SQLite has to write beside it; copy it, "
                f"with {path.name}-wal where there is one, to a directory that can be written, and name that"
            ) from error
        raise


def _is_ours(path: Path) -> bool:
    """Whether the header says that it is a journal, whatever else may be wrong with the file."""
    with path.open("rb") as file:
        head = file.read(_APPLICATION_ID_AT + 4)
    return head.startswith(_MAGIC) and int.from_bytes(head[_APPLICATION_ID_AT:]) == APPLICATION_ID


def set_aside(path: Path) -> Path:
    """Give a damaged journal, with its log, another name beside its own; returns that."""
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%fZ")
    aside = path.with_name(f"{path.name}.damaged-{stamp}")
    for suffix in ("-wal", "-shm", ""):
        with contextlib.suppress(FileNotFoundError):
            path.with_name(path.name + suffix).rename(aside.with_name(aside.name + suffix))
    return aside


def check_header(path: Path) -> None:
    """Refuse a file that is not ours before SQLite has it.

    SQLite takes a single byte for an empty file, and writes another program's log into its database. For the
    one writer only: closing a file drops the locks that the process has on it, SQLite's too.
    """
    try:
        with path.open("rb") as file:
            head = file.read(_APPLICATION_ID_AT + 4)
    except OSError:
        return  # it is not there, or SQLite will say what is wrong
    if not head or path.with_name(f"{path.name}-journal").exists():  # new, or cut off while it was made
        return
    if not head.startswith(_MAGIC):
        raise ForeignJournalError(f"{path}: not a journal, not even a database; {ANOTHER}")
    if int.from_bytes(head[_APPLICATION_ID_AT:]) != APPLICATION_ID:
        raise ForeignJournalError(f"{path}: a database, but no journal of impactcell; {ANOTHER}")


def _create(database: sqlite3.Connection, cell: str) -> None:
    """Write an empty journal in one transaction: what is cut off is empty, not a foreign database."""
    database.execute("BEGIN")  # not IMMEDIATE: that makes the first page, and fixes what the next line sets
    database.execute("PRAGMA auto_vacuum = INCREMENTAL")
    for statement in TABLES.split(";"):
        database.execute(statement)
    database.execute("INSERT INTO meta VALUES ('cell', ?, ?)", (cell, row_crc(["cell", cell])))
    database.execute(f"PRAGMA application_id = {APPLICATION_ID}")
    database.execute(f"PRAGMA user_version = {FORMAT}")
    database.execute("COMMIT")


def _check(database: sqlite3.Connection, path: Path, cell: str | None) -> None:
    """Refuse what is no journal, of a format that is not known, or of another cell than `cell`."""
    application_id, version = _pragma(database, "application_id"), _pragma(database, "user_version")
    if application_id != APPLICATION_ID:
        raise ForeignJournalError(f"{path}: a database, but no journal of impactcell; {ANOTHER}")
    if not OLDEST <= version <= FORMAT:
        of = "" if cell is None else f" of cell '{cell}'"
        raise ForeignJournalError(
            f"{path}: the journal{of} has format {version}, this version of the program knows {OLDEST} to "
            f"{FORMAT}; it is left as it is: {WAY_OUT}"
        )
    stored_cell = _stored_cell(database)
    if cell is not None and stored_cell != cell:
        raise ForeignJournalError(
            f"{path}: the journal of cell '{stored_cell}', not of '{cell}'; name another file"
        )


def _stored_cell(database: sqlite3.Connection) -> str:
    row = database.execute("SELECT value FROM meta WHERE key = 'cell'").fetchone()
    return str(row[0]) if row else ""


def unreadable_state(path: Path, cell: str, why: ValueError) -> ForeignJournalError:
    """Say that a journal's state is of a later version, or damaged."""
    return ForeignJournalError(f"{path}: the journal of cell '{cell}' is left as it is, {why}: {WAY_OUT}")


def _upgrade_file(database: sqlite3.Connection, path: Path, upgrade: Upgrade | None) -> None:
    """Bring a file of an earlier format up to this one: columns, tables and state, all or nothing."""
    version = _pragma(database, "user_version")
    row = database.execute("SELECT * FROM state").fetchone()  # id, seq, blob and, from format 5 on, crc
    whole = row is not None and (len(row) < 4 or row[3] in (None, row_crc([row[2]])))
    try:
        state = upgrade(bytes(row[2])) if whole and upgrade is not None else None
    except ValueError as error:
        raise unreadable_state(path, _stored_cell(database), error) from error
    present = {name for _, name, *_ in database.execute("PRAGMA table_info (cycles)")}
    absent = [column for column in COLUMNS if column.name not in present]
    if version == FORMAT and state is None and not absent:
        return
    database.execute("BEGIN IMMEDIATE")
    try:
        for column in absent:  # a quantity that was not published when the file was made
            database.execute(f"ALTER TABLE cycles ADD COLUMN {column.name} {column.sql_type}")
        for earlier in range(version, FORMAT):
            for statement in UPGRADES[earlier]:
                database.execute(statement)
        if state is not None:
            database.execute("INSERT INTO earlier_states (seq, blob) SELECT seq, blob FROM state")
            database.execute("UPDATE state SET blob = ?, crc = ?", (state, row_crc([state])))
        database.execute(f"PRAGMA user_version = {FORMAT}")
        database.execute("COMMIT")
    except BaseException:
        if database.in_transaction:
            database.execute("ROLLBACK")
        raise
