"""What takes long to compute and tests of several files look at: one worker computes it, others read it."""

import fcntl
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")
_directories: list[Path] = []
"""The one that this run's workers have in common, once `share_in` has said it."""


def share_in(directory: Path) -> None:
    """Say where results of this run lie; `tests/conftest.py` does, for each worker."""
    _directories[:] = [directory]


def computed_once(name: str, compute: Callable[[], T]) -> T:
    """Give what `compute` gives, by itself or as another worker of this run has written it under the name.

    Whoever comes while it is being computed waits. Where it raises, nothing is written and the next computes.
    """
    (directory,) = _directories
    written = directory / f"{name}.pickle"
    with (directory / f"{name}.turn").open("wb") as turn:
        fcntl.flock(turn, fcntl.LOCK_EX)  # until it is closed
        if written.exists():
            found: T = pickle.loads(written.read_bytes())
            return found
        result = compute()
        written.write_bytes(pickle.dumps(result))
        return result
