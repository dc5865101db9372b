"""Event loops whose clocks are turned on while nothing is left to do: waiting costs little or no time."""

import asyncio
import selectors
import time
from collections.abc import Coroutine
from typing import Any, TypeVar

T = TypeVar("T")


class _Selector(selectors.SelectSelector):
    """Turns the clock on instead of waiting, once nothing has come for `grace_s` of real time."""

    now_s = 0.0

    def __init__(self, grace_s: float) -> None:
        super().__init__()
        self._grace_s = grace_s

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        ready = super().select(0.0)
        if not ready and timeout != 0.0 and self._grace_s:
            ready = super().select(self._grace_s)
        if not ready and timeout:
            self.now_s += timeout
        return ready


class VirtualLoop(asyncio.SelectorEventLoop):
    """Its `time()` begins at 0 s.

    `grace_s`: what goes through the system, such as the bytes of a pseudo terminal, takes that long at most.
    """

    def __init__(self, grace_s: float = 0.0) -> None:
        self._virtual = _Selector(grace_s)
        super().__init__(self._virtual)

    def time(self) -> float:
        return self._virtual.now_s


class _HastySelector(selectors.DefaultSelector):
    """Lets time pass quickly, but only while nothing comes."""

    HASTE = 40.0
    """Seconds of the loop in a second in which nothing comes: a timeout of 10 s is a quarter of a second's
    silence, so that no reply that is on its way between two sockets of this process is ever given up."""
    TIMEOUT_S, SILENCE_S = 1.0, 0.25
    """A timer that is at least so long is the limit of an answer, and takes at least so much real silence:
    the bytes of a pseudo terminal are carried by a thread of the kernel, which waits for its turn too."""
    skipped_s = 0.0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if not timeout or timeout < 0.0:
            return super().select(timeout)
        began_s = time.monotonic()
        least_s = self.SILENCE_S if timeout >= self.TIMEOUT_S else 0.0
        ready = super().select(max(timeout / self.HASTE, least_s))
        if not ready:
            self.skipped_s += max(0.0, timeout - (time.monotonic() - began_s))
        return ready


class HastyLoop(asyncio.SelectorEventLoop):
    """Its `time()` goes on as the clock of the machine does, and faster while there is nothing to do.

    For clients and servers in one process: who waits for a timer alone does not wait long, and what takes
    time because the machine is busy takes the same time on this clock.
    """

    def __init__(self) -> None:
        self._hasty = _HastySelector()
        super().__init__(self._hasty)

    def time(self) -> float:
        return super().time() + self._hasty.skipped_s


def run_virtually(coroutine: Coroutine[Any, Any, T], grace_s: float = 0.0) -> T:
    """Run a coroutine in virtual time; it may not wait for anything outside the process."""
    with asyncio.Runner(loop_factory=lambda: VirtualLoop(grace_s)) as runner:
        return runner.run(coroutine)
