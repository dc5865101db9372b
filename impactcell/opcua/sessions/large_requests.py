"""Long requests are answered one at a time, and garbage is looked for between them.

A full round of the garbage collector looks at all that lives and holds everybody meanwhile: 65 ms with three
requests of twenty thousand path elements each. So there is one such request at a time, and the round, which
the interpreter begins whenever it sees fit, waits in the same line.
"""

import asyncio
import contextlib
import ctypes
import gc
import sys
from collections.abc import AsyncIterator
from typing import Final

LARGE_BYTES: Final = 64 * 1024
"""Length from which a request waits for the one before: one chunk, some two thousand values to read."""
COLLECT_EVERY_S: Final = 10.0
"""Time between two full rounds of the garbage collector, seconds."""
NEVER: Final = 1_000_000_000
"""Threshold of the oldest generation at which the interpreter does not begin a full round by itself."""


class Turn:
    """One request's turn in the line; without a lock, that of a short one, it is always there."""

    def __init__(self, lock: asyncio.Lock | None) -> None:
        self._lock = lock
        self._held = False

    async def begin(self) -> None:
        """Wait for those before."""
        if self._lock is not None:
            await self._lock.acquire()
            self._held = True

    def end(self) -> None:
        """Let the next one begin."""
        if self._lock is not None and self._held:
            self._held = False
            self._lock.release()

    @contextlib.asynccontextmanager
    async def left(self) -> AsyncIterator[None]:
        """Let the others pass while something is awaited that does not need the loop, as a disk.

        Whoever is done stands in line again for the answer; an error goes on without.
        """
        self.end()
        yield
        await self.begin()


class LargeRequests:
    """The line of the long requests of all clients."""

    def __init__(self) -> None:
        self._lock = asyncio.Lock()

    @contextlib.asynccontextmanager
    async def turn(self, size: int) -> AsyncIterator[Turn]:
        """Have a request of so many bytes answered inside; a short one waits for nobody."""
        turn = Turn(self._lock if size >= LARGE_BYTES else None)
        await turn.begin()
        try:
            yield turn
        finally:
            turn.end()

    async def collect_garbage(self) -> None:
        """Look for garbage again and again, while no long request is being answered."""
        while True:
            await asyncio.sleep(COLLECT_EVERY_S)
            async with self._lock:
                gc.collect()
                give_back_memory()


def give_back_memory() -> None:
    """Let the C library return what it keeps of freed memory: under 1 ms; nothing where it is not glibc.

    It returns by itself only what lies above the last block in use: long answers left 4 MB below it.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(ctypes.c_size_t(0))


def leave_full_rounds_to_the_server() -> None:
    """Keep the interpreter from full rounds of its own; `LargeRequests.collect_garbage` does them."""
    youngest, middle, _ = gc.get_threshold()
    gc.set_threshold(youngest, middle, NEVER)
