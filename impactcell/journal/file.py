"""The journal's file: opened, checked to be ours, and its errors by name."""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from impactcell.errors import ForeignJournalError, JournalError, JournalFullError
from impactcell.journal.schema import APPLICATION_ID, FORMAT, TABLES


@contextmanager
def errors(path: Path) -> Iterator[None]:
    """Turn SQLite's errors into ours, which say whether trying again can help."""
    try:
        yield
    except sqlite3.OperationalError as error:
        if error.sqlite_errorcode & 0xFF in (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR):
            raise JournalFullError(f"{path}: the disk or its quota is full ({error}); make room") from error
        raise JournalFullError(
            f"{path}: cannot be written now ({error}); check its disk, directory and owner"
        ) from error
    except (sqlite3.DatabaseError, OverflowError) as error:
        raise JournalError(f"{path}: cannot be used ({error})") from error


def opened(path: Path, cell: str | None, *, read_only: bool) -> sqlite3.Connection:
    """Open a journal's file, made anew where it is empty and may be written.

    Raises
    ------
    ForeignJournalError
        The file is not a journal, of another format, or of another cell; it is left as it is.
    JournalError
        It cannot be opened.
    """
    try:
        database = sqlite3.connect(
            f"{path.absolute().as_uri()}?mode={'ro' if read_only else 'rwc'}",
            uri=True,
            isolation_level=None,
            check_same_thread=False,
        )
    except sqlite3.Error as error:
        raise JournalError(f"{path}: cannot be opened ({error}); check its directory and owner") from error
    try:
        if _pages(database, path) == 0 and not read_only:
            with errors(path):
                _create(database, cell or "")
        _check(database, path, cell)
        if not read_only:
            with errors(path):
                database.execute("PRAGMA journal_mode = WAL")
                database.execute("PRAGMA synchronous = FULL")
    except BaseException:
        database.close()
        raise
    return database


def _pragma(database: sqlite3.Connection, name: str) -> int:
    return int(database.execute(f"PRAGMA {name}").fetchone()[0])


def _pages(database: sqlite3.Connection, path: Path) -> int:
    try:
        return _pragma(database, "page_count")
    except sqlite3.DatabaseError as error:
        if error.sqlite_errorcode & 0xFF in (sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_CORRUPT):
            raise ForeignJournalError(f"{path}: not a journal ({error}); it is left as it is") from error
        raise JournalError(f"{path}: cannot be opened ({error}); check its owner and directory") from error


def _create(database: sqlite3.Connection, cell: str) -> None:
    database.execute("PRAGMA auto_vacuum = INCREMENTAL")
    database.execute("BEGIN IMMEDIATE")
    for statement in TABLES.split(";"):
        database.execute(statement)
    database.execute("INSERT INTO meta VALUES ('cell', ?)", (cell,))
    database.execute(f"PRAGMA application_id = {APPLICATION_ID}")
    database.execute(f"PRAGMA user_version = {FORMAT}")
    database.execute("COMMIT")


def _check(database: sqlite3.Connection, path: Path, cell: str | None) -> None:
    application_id, version = _pragma(database, "application_id"), _pragma(database, "user_version")
    if application_id != APPLICATION_ID:
        raise ForeignJournalError(f"{path}: a database, but no journal of impactcell; it is left as it is")
    if version != FORMAT:
        raise ForeignJournalError(
            f"{path}: journal format {version}, this program writes {FORMAT}; it is left as it is: "
            "name another file"
        )
    with errors(path):
        (kept,) = database.execute("SELECT value FROM meta WHERE key = 'cell'").fetchone()
    if cell is not None and kept != cell:
        raise ForeignJournalError(f"{path}: the journal of cell '{kept}', not of '{cell}'; name another file")
