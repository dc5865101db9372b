"""Work that a stop ends at once, and work that it must not end halfway."""

import asyncio
import threading

import pytest

from impactcell.process.stopping import in_passing_thread, unless_stopped, whole
from tests.patience import PATIENCE_S


async def test_a_stop_cancels_what_is_under_way() -> None:
    stop, begun = asyncio.Event(), asyncio.Event()

    async def work() -> None:
        begun.set()
        await asyncio.Event().wait()

    working = asyncio.create_task(unless_stopped(work(), stop))
    await begun.wait()
    stop.set()
    async with asyncio.timeout(PATIENCE_S):
        assert await working is False


async def test_what_is_done_and_what_fails_is_told() -> None:
    async def fail() -> None:
        raise ValueError("no")

    assert await unless_stopped(asyncio.sleep(0), asyncio.Event())
    with pytest.raises(ValueError, match="no"):
        await unless_stopped(fail(), asyncio.Event())


@pytest.mark.parametrize("fails", [False, True])
async def test_what_must_be_whole_is_done_before_its_cancellation_comes(fails: bool) -> None:
    begun, may_end, done = asyncio.Event(), asyncio.Event(), []

    async def work() -> None:
        begun.set()
        await may_end.wait()
        done.append(True)
        if fails:
            raise ValueError("heard by nobody")

    working = asyncio.create_task(whole(work()))
    await begun.wait()
    working.cancel()
    await asyncio.sleep(0)
    assert not working.done()
    may_end.set()
    with pytest.raises(asyncio.CancelledError):
        await working
    assert done == [True]


async def test_a_thread_that_passes_keeps_nobody() -> None:
    may_end, begun = threading.Event(), threading.Event()

    def work() -> bool:
        begun.set()
        return may_end.wait()

    working = asyncio.create_task(in_passing_thread(work))
    await asyncio.to_thread(begun.wait)
    working.cancel()
    with pytest.raises(asyncio.CancelledError):
        await working
    assert not may_end.is_set()
    may_end.set()


async def test_what_a_passing_thread_gives_or_raises_comes_back() -> None:
    def fail() -> None:
        raise ValueError("no")

    assert await in_passing_thread(lambda: 3) == 3
    with pytest.raises(ValueError, match="no"):
        await in_passing_thread(fail)
