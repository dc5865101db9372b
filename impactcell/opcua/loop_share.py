"""How long one request may keep the event loop: others come in between.

What takes long for what a client may ask in one request is done piece by piece. Whoever has had the loop for
`SLICE_S` waits for a turn, and there is one turn in each round of the loop, however many ask: between two of
them everybody else is served, the cells first of all.
"""

import asyncio
import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import Final, TypeVar

T = TypeVar("T")
R = TypeVar("R")

SLICE_S: Final = 0.002
"""Longest time on the loop without giving way, seconds, and what one piece takes longer."""


class Turns:
    """The line of those who have had the loop for long."""

    def __init__(self) -> None:
        self._line: deque[asyncio.Future[None]] = deque()

    async def wait(self) -> None:
        """Wait for a round of the loop of one's own."""
        await self._stand_in_line()

    def call(self, work: Callable[[], None]) -> None:
        """Have something done in a round of the loop of its own."""
        self._stand_in_line().add_done_callback(lambda _: work())

    def _stand_in_line(self) -> asyncio.Future[None]:
        loop = asyncio.get_running_loop()
        turn = loop.create_future()
        self._line.append(turn)
        if len(self._line) == 1:
            loop.call_soon(self._next)
        return turn

    def _next(self) -> None:
        turn = self._line.popleft()
        if not turn.done():
            turn.set_result(None)
        if self._line:
            # Whoever has the turn now runs in the next round, and the one after him in the round after that.
            loop = asyncio.get_running_loop()
            loop.call_soon(loop.call_soon, self._next)


class LoopShare:
    """The share of one client in the event loop.

    Parameters
    ----------
    turns : Turns
        The line that all clients stand in.
    """

    def __init__(self, turns: Turns) -> None:
        self.turns = turns
        self._begun = time.perf_counter()

    def begin(self) -> None:
        """Begin to count: until now somebody else had the loop."""
        self._begun = time.perf_counter()

    async def give_way(self) -> None:
        """Let the others have their turn, if this one has lasted long enough."""
        if time.perf_counter() - self._begun > SLICE_S:
            await self.turns.wait()
            self._begun = time.perf_counter()

    async def each(self, items: Iterable[T], work: Callable[[T], R]) -> list[R]:
        """Do something with each of many items; others have their turns in between."""
        results = list[R]()
        for item in items:
            results.append(work(item))
            await self.give_way()
        return results
