"""What lies at a path: what nobody may look at is told, and not taken for nothing."""

import enum
import stat
from pathlib import Path


class Kind(enum.Enum):
    """What lies at a path, links followed."""

    NOTHING = "nothing"
    DIRECTORY = "directory"
    FILE = "file"
    """Or a pipe, a terminal, a socket."""


def kind_at(path: Path) -> Kind:
    """Look what lies at a path.

    Raises
    ------
    OSError
        Nobody may look there, or nothing can be called like this. What pathlib asks of a path raises it up to
        Python 3.13; from then on it says that there is nothing.
    """
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return Kind.NOTHING
    return Kind.DIRECTORY if stat.S_ISDIR(mode) else Kind.FILE
