"""What others than its owner can do with a file, by its mode."""

import os
import stat
from pathlib import Path
from typing import Final

_WRITTEN: Final = stat.S_IWGRP | stat.S_IWOTH
"""Mode bits of a file that others than its owner can write."""
_READ: Final = stat.S_IROTH
"""Mode bit of a file that everybody can read; a group of its own may be there to."""


def what_others_can(file: Path) -> tuple[str, ...]:
    """Say whether others can `read` or `write` a file; nothing of one that cannot be looked at.

    Elsewhere than on POSIX a mode tells nothing of who may, and nothing is said.
    """
    if os.name != "posix":
        return ()
    try:
        mode = file.stat().st_mode
    except (OSError, ValueError):
        return ()
    if not stat.S_ISREG(mode):
        return ()
    return tuple(word for word, bits in (("read", _READ), ("write", _WRITTEN)) if mode & bits)
