"""What many listen to is told in slices, in order: cells do not wait for their listeners.

In one round of the loop so many are told at once, of whatever; all others in later rounds.
"""

import asyncio
import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any, Final

from impactcell.opcua.loop_share import SLICE_S

AT_ONCE: Final = 500
"""So many listeners to values are told at once in a round of the loop: some 2 ms."""

Listener = Callable[[Any], None]


class FanOut:
    """Tells listeners, the first thing to all of them before the next.

    Parameters
    ----------
    at_once : int
        So many listeners are told at once in a round of the loop; more are told in slices.
    """

    def __init__(self, at_once: int = AT_ONCE) -> None:
        self._at_once = at_once
        self._room = at_once
        self._waiting: deque[tuple[Listener, object]] = deque()

    def deliver(self, listeners: Iterable[Listener], news: object) -> None:
        """Tell something to listeners: at once where they are few, and in later rounds of the loop else."""
        told = tuple(listeners)
        if not told:
            return
        if len(told) <= self._room and not self._waiting:
            if self._room == self._at_once:
                asyncio.get_running_loop().call_soon(self._begin_round)
            self._room -= len(told)
            for listener in told:
                listener(news)
            return
        if not self._waiting:
            asyncio.get_running_loop().call_soon(self._slice)
        self._waiting.extend((listener, news) for listener in told)

    def _begin_round(self) -> None:
        self._room = self._at_once

    def _slice(self) -> None:
        begun = time.perf_counter()
        while self._waiting and time.perf_counter() - begun < SLICE_S:
            listener, news = self._waiting.popleft()
            listener(news)
        if self._waiting:
            asyncio.get_running_loop().call_soon(self._slice)
