"""Whether the files that a journal writes are still those at its path.

A file that is removed or replaced while it is open can be written on, and nobody will ever read it: no error
comes from the system. So the journal looks, after each transaction.
"""

import os
from pathlib import Path
from typing import Final

from impactcell.errors import JournalGoneError

_SUFFIXES: Final = ("", "-wal")
"""The database, and the log that commits go to."""

Identity = tuple[int, int]


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
