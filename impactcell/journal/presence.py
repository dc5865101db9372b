"""Whether the files that a journal writes may be written, and are still those at its path.

A file that is removed or replaced while it is open can be written on, and nobody will ever read it: no error
comes from the system. So the journal looks, after each transaction.
"""

import errno
import os
from pathlib import Path
from typing import Final

from impactcell.errors import JournalGoneError

_SUFFIXES: Final = ("", "-wal")
"""The database, and the log that commits go to."""

Identity = tuple[int, int]


def check_writable(path: Path) -> None:
    """See that a journal may be written: SQLite opens it all the same, and would not notice when it may be.

    Raises
    ------
    PermissionError
        If the file, or one that SQLite keeps beside it, may only be read.
    """
    for suffix in (*_SUFFIXES, "-shm"):
        file = path.with_name(path.name + suffix)
        if file.exists() and not os.access(file, os.W_OK):
            raise PermissionError(errno.EACCES, f"{file.name}: {os.strerror(errno.EACCES)}")


class FilePresence:
    """The files of one open journal, as they were when it was opened or first written."""

    def __init__(self, path: Path) -> None:
        self._paths = [str(path) + suffix for suffix in _SUFFIXES]
        self._seen: dict[str, Identity] = {}

    def check(self) -> None:
        """See that the files are there and the same as before.

        Raises
        ------
        JournalGoneError
            If one is not.
        """
        for path in self._paths:
            identity = _identity(path)
            before = self._seen.get(path)
            if before is None and identity is not None:
                self._seen[path] = identity
            elif identity != before:
                what = "is gone" if identity is None else "was replaced by another file"
                raise JournalGoneError(
                    f"{path} {what} while the journal was in use; what it held up to then is lost unless "
                    "it is put back, a new one is begun in its place"
                )


def _identity(path: str) -> Identity | None:
    try:
        status = os.stat(path)  # noqa: PTH116 - of each cycle: a Path takes several times as long
    except FileNotFoundError:
        return None
    return status.st_dev, status.st_ino
