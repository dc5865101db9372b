"""One writer a journal."""

import contextlib
import fcntl
import os
import stat
from pathlib import Path
from typing import IO

from impactcell.errors import JournalError, JournalUnavailableError
from impactcell.journal.database import check_header


def lock_journal(path: Path) -> IO[str]:
    """Keep a second service from the same journal: a lock beside it, held as long as it is open.

    It lies beside the file itself, not beside a symbolic link to it; whatever is there under its name already
    is neither waited for nor written to. What is no plain file is refused, and so is one with a second name
    (a hard link): SQLite keeps a log for each name, and what one log holds is not in the file under the other
    (SQLite, How To Corrupt An SQLite Database File, section 2.5). Beside a file that is no journal no lock is
    begun.

    Raises
    ------
    ForeignJournalError
        The file is not a journal.
    JournalError
        Another service holds it, or the path is no plain file with one name.
    """
    check_file(path)
    lock_file = _lock_file(path)
    # With a lock file somebody in this process may hold locks that a look at the journal would drop.
    if not lock_file.exists():
        check_header(path)
    try:
        return _taken(lock_file)
    except BlockingIOError as error:
        raise JournalError(
            f"{path}: another service writes this journal; end it first: to remove its lock does not help"
        ) from error


def kept_lock(lock: IO[str], path: Path) -> IO[str]:
    """Return the lock that is held; taken anew where somebody has removed its file.

    Raises
    ------
    JournalUnavailableError
        Another service has taken it meanwhile.
    """
    lock_file = _lock_file(path)
    held = os.fstat(lock.fileno())
    try:
        there = lock_file.stat()
        if (there.st_dev, there.st_ino) == (held.st_dev, held.st_ino):
            return lock
    except FileNotFoundError:
        pass
    try:
        taken = _taken(lock_file)
    except BlockingIOError as error:
        raise JournalUnavailableError(
            f"{path}: another service has begun to write this journal, for its lock was removed; end one of "
            "them"
        ) from error
    except OSError:  # nobody can take it there
        return lock
    lock.close()
    return taken


def _lock_file(path: Path) -> Path:
    file = Path(os.path.realpath(path))
    return file.with_name(f"{file.name}.lock")


def _taken(lock_file: Path) -> IO[str]:
    """Take a lock; raises BlockingIOError where somebody else holds it."""
    flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NONBLOCK
    lock = os.fdopen(os.open(lock_file, flags, 0o644), "w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        lock.close()
        raise
    return lock


def check_file(path: Path) -> None:
    """Refuse what is no plain file with one name; raises `JournalError`."""
    with contextlib.suppress(FileNotFoundError):
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise JournalError(f"{path}: is a directory or a device, not a file; name another file")
        if status.st_nlink > 1:
            raise JournalError(
                f"{path}: the file has another name as well (a hard link), under which another service could "
                "write it; remove that name, or make a copy of the file under this one"
            )
