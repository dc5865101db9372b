"""An event loop whose clock is turned on as soon as nothing is left to do: waiting costs no time."""

import asyncio
import selectors
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


def run_virtually(coroutine: Coroutine[Any, Any, T], grace_s: float = 0.0) -> T:
    """Run a coroutine in virtual time; it may not wait for anything outside the process."""
    with asyncio.Runner(loop_factory=lambda: VirtualLoop(grace_s)) as runner:
        return runner.run(coroutine)
