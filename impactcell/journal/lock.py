"""One writer a journal."""

import contextlib
import fcntl
import os
import stat
from pathlib import Path
from typing import IO

from impactcell.errors import JournalError
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
    file = Path(os.path.realpath(path))
    lock_file = file.with_name(f"{file.name}.lock")
    # With a lock file somebody in this process may hold locks that a look at the journal would drop.
    if not lock_file.exists():
        check_header(path)
    flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NONBLOCK
    lock = os.fdopen(os.open(lock_file, flags, 0o644), "w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        lock.close()
        raise JournalError(f"{path}: another service writes this journal; end it first") from error
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
