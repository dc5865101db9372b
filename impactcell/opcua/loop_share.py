"""How long one request may keep the event loop: others come in between.

What takes long for what a client may ask in one request is done piece by piece, and between two pieces that
took longer than `SLICE_S` everybody else has a turn.
"""

import asyncio
import time
from collections.abc import Callable, Iterable
from typing import Final, TypeVar

T = TypeVar("T")
R = TypeVar("R")

SLICE_S: Final = 0.002
"""Longest time on the loop without giving way, seconds, and what one piece takes longer."""


class LoopShare:
    """The share of one request in the event loop."""

    def __init__(self) -> None:
        self._begun = time.perf_counter()

    async def give_way(self) -> None:
        """Let the others have their turn, if this one has lasted long enough."""
        if time.perf_counter() - self._begun > SLICE_S:
            await asyncio.sleep(0)
            self._begun = time.perf_counter()


async def each(items: Iterable[T], work: Callable[[T], R]) -> list[R]:
    """Do something with each of many items; others have their turns in between."""
    share, results = LoopShare(), list[R]()
    for item in items:
        results.append(work(item))
        await share.give_way()
    return results
