"""Who is told that machine code is being compiled, which on a new machine takes a minute or more.

Apart from `jit`, so that who asks to be told need not load the compiler.
"""

from collections.abc import Callable
from typing import Final

COMPILING: Final = "compiling for this machine, once: a minute or two, longer on a slow or busy one"
"""Said when machine code is missing, after an installation or an update."""

_listeners: list[Callable[[], None]] = []


def on_compilation(listener: Callable[[], None]) -> None:
    """Have `listener` called, and nobody else, the next time this process lacks machine code on disk."""
    _listeners[:] = [listener]


def announce_compilation() -> None:
    """Tell who asked for it, once."""
    if _listeners:
        _listeners.pop()()
