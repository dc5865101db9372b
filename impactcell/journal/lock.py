"""One writer a journal."""

import fcntl
from pathlib import Path
from typing import IO

from impactcell.errors import JournalError


def lock_journal(path: Path) -> IO[str]:
    """Keep a second service from the same journal: a lock beside it, held as long as it is open."""
    lock = path.with_name(f"{path.name}.lock").open("w")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        lock.close()
        raise JournalError(f"{path}: another service writes this journal; end it first") from error
    return lock
