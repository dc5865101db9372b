"""One writer a journal."""

import contextlib
import fcntl
from pathlib import Path
from typing import IO

from impactcell.errors import JournalError


def lock_journal(path: Path) -> IO[str]:
    """Keep a second service from the same journal: a lock beside it, held as long as it is open.

    It lies beside the file itself, not beside a symbolic link to it. A file with a second name (a hard link)
    is refused: SQLite keeps a log for each name, and what one log holds is not in the file under the other
    (SQLite, How To Corrupt An SQLite Database File, section 2.5).
    """
    file = path.resolve()
    with contextlib.suppress(FileNotFoundError):
        if file.stat().st_nlink > 1:
            raise JournalError(
                f"{path}: the file has another name as well (a hard link), under which another service could "
                "write it; remove that name, or make a copy of the file under this one"
            )
    lock = file.with_name(f"{file.name}.lock").open("w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        lock.close()
        raise JournalError(f"{path}: another service writes this journal; end it first") from error
    return lock
