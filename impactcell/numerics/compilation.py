"""Who is told that machine code is being compiled, which on a new machine takes a minute or more.

Apart from `jit`, so that who asks to be told need not load the compiler.
"""

import threading
from collections.abc import Callable
from typing import Final

COMPILING: Final = "compiling for this machine, once: a minute or two, longer on a slow or busy one"
"""Said when machine code is missing, after an installation or an update."""

_listeners: list[Callable[[], None]] = []
_lacked = threading.Event()


def on_compilation(listener: Callable[[], None]) -> None:
    """Have `listener` called, and nobody else, the next time this process lacks machine code on disk."""
    _listeners[:] = [listener]


def has_lacked_code() -> bool:
    """Say whether this process has lacked machine code on disk: its start is then one that compiles."""
    return _lacked.is_set()


def announce_compilation() -> None:
    """Tell who asked for it, once; from then on `has_lacked_code`."""
    _lacked.set()
    if _listeners:
        _listeners.pop()()
