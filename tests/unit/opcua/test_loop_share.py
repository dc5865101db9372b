"""Whoever asks for much waits for turns, one in a round of the loop; what many hear is told in slices."""

import asyncio
import ctypes
import gc
import itertools
from collections.abc import Callable
from types import SimpleNamespace

import psutil
import pytest

from impactcell.opcua.fan_out import AT_ONCE, FanOut
from impactcell.opcua.loop_share import SLICE_S, LoopShare, Turns
from impactcell.opcua.sessions.large_requests import (
    LARGE_BYTES,
    NEVER,
    LargeRequests,
    give_back_memory,
    leave_full_rounds_to_the_server,
)

PIECES = 10


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock by which a turn is over after so many pieces."""
    counted = SimpleNamespace(perf_counter=itertools.count(0.0, SLICE_S / PIECES).__next__)
    monkeypatch.setattr("impactcell.opcua.loop_share.time", counted)
    monkeypatch.setattr("impactcell.opcua.fan_out.time", counted)


@pytest.mark.usefixtures("clock")
async def test_between_two_turns_everybody_else_has_one() -> None:
    """Many ask for much: between two slices, of whomever, the loop goes round."""
    turns, done, rounds = Turns(), list[int](), 0

    async def client(number: int) -> None:
        await LoopShare(turns).each(range(200), lambda _: done.append(number))

    async def others() -> None:
        nonlocal rounds
        longest = 0
        while not all(task.done() for task in tasks):
            before = len(done)
            await asyncio.sleep(0)
            rounds += 1
            if rounds > 2 * len(tasks):  # all of them may begin at once
                longest = max(longest, len(done) - before)
        assert longest <= PIECES + 1

    tasks = [asyncio.ensure_future(client(number)) for number in range(20)]
    await others()
    await asyncio.gather(*tasks)
    assert len(done) == 20 * 200
    assert rounds >= 20 * 200 / (PIECES + 1)
    # In line: none is through before the others have had nearly as much.
    assert set(done[-20 * PIECES :]) == set(range(20))


@pytest.mark.usefixtures("clock")
async def test_one_who_leaves_the_line_does_not_stop_it() -> None:
    turns, done = Turns(), list[int]()

    async def client(number: int) -> None:
        await LoopShare(turns).each(range(100), lambda _: done.append(number))

    tasks = [asyncio.ensure_future(client(number)) for number in range(5)]
    for _ in range(5):
        await asyncio.sleep(0)
    tasks[0].cancel()
    tasks[3].cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    assert [done.count(number) for number in (1, 2, 4)] == [100, 100, 100]


@pytest.mark.usefixtures("clock")
async def test_many_listeners_are_told_in_slices_and_in_order() -> None:
    fan_out, told = FanOut(), [list[int]() for _ in range(AT_ONCE + 1)]
    fan_out.deliver([entries.append for entries in told], 1)
    assert not any(told), "told at once"
    fan_out.deliver([told[0].append], 2)  # few, but after the first
    rounds = 0
    while len(told[0]) < 2:
        before = sum(map(len, told))
        await asyncio.sleep(0)
        rounds += 1
        assert sum(map(len, told)) - before <= PIECES + 1
    assert told[0] == [1, 2]
    assert all(entries == [1] for entries in told[1:])
    assert rounds >= (AT_ONCE + 2) / (PIECES + 1)


@pytest.mark.usefixtures("clock")
async def test_much_news_for_few_listeners_is_told_in_slices_too() -> None:
    """What is told at once is counted over a round of the loop, not over one piece of news."""
    fan_out, told = FanOut(10), list[int]()
    for number in range(100):
        fan_out.deliver([told.append, lambda _: None], number)
    assert told == list(range(5))
    rounds = 0
    while len(told) < 100:
        before = len(told)
        await asyncio.sleep(0)
        rounds += 1
        assert len(told) - before <= PIECES + 1
    assert told == list(range(100))
    assert rounds >= 190 / (PIECES + 1)
    fan_out.deliver([told.append], 100)
    assert told[-1] == 100, "in a new round there is room again"


async def test_turns_of_those_who_call_are_one_in_a_round() -> None:
    turns, told = Turns(), list[int]()
    for number in range(5):
        turns.call(lambda number=number: told.append(number))
    assert not told
    while len(told) < 5:
        before = len(told)
        await asyncio.sleep(0)
        assert len(told) - before <= 1
    assert told == list(range(5))


async def test_long_requests_are_answered_one_at_a_time_and_short_ones_at_once() -> None:
    line, inside, together = LargeRequests(), list[int](), list[int]()

    async def request(size: int) -> None:
        async with line.turn(size):
            inside.append(size)
            together.append(sum(other >= LARGE_BYTES for other in inside))
            try:
                for _ in range(5):
                    await asyncio.sleep(0)
            finally:
                inside.remove(size)

    tasks = [asyncio.ensure_future(request(size)) for size in (LARGE_BYTES, LARGE_BYTES + 1, LARGE_BYTES - 1)]
    await asyncio.sleep(0)
    assert sorted(inside) == [LARGE_BYTES - 1, LARGE_BYTES]
    tasks[0].cancel()  # whoever hangs up leaves the line
    await asyncio.gather(*tasks, return_exceptions=True)
    assert max(together) == 1
    assert len(together) == 3


async def test_who_leaves_the_line_stands_in_it_again_and_an_error_does_not() -> None:
    line, said = LargeRequests(), list[str]()

    async def request(name: str, outside: asyncio.Event, *, fails: bool = False) -> None:
        async with line.turn(LARGE_BYTES) as turn:
            said.append(f"{name} begins")
            async with turn.left():
                await outside.wait()
                if fails:
                    raise ValueError(name)
            said.append(f"{name} goes on")
            await asyncio.sleep(0)
            said.append(f"{name} ends")

    disk = [asyncio.Event() for _ in range(4)]
    tasks = [asyncio.ensure_future(request(str(n), disk[n], fails=n == 2)) for n in range(4)]
    await until(lambda: len(said) == 4)
    tasks[3].cancel()  # whoever hangs up while he waits
    disk[2].set()
    disk[1].set()
    disk[0].set()
    outcomes = await asyncio.gather(*tasks, return_exceptions=True)
    assert said[4:] == ["1 goes on", "1 ends", "0 goes on", "0 ends"] or said[4:] == [
        "0 goes on", "0 ends", "1 goes on", "1 ends",
    ]  # fmt: skip
    assert [type(outcome) for outcome in outcomes] == [
        type(None),
        type(None),
        ValueError,
        asyncio.CancelledError,
    ]
    async with line.turn(LARGE_BYTES):
        said.append("the line is free")


async def until(holds: Callable[[], bool]) -> None:
    while not holds():
        await asyncio.sleep(0)


async def test_garbage_is_looked_for_between_long_requests(monkeypatch: pytest.MonkeyPatch) -> None:
    line, rounds = LargeRequests(), list[int]()
    monkeypatch.setattr("impactcell.opcua.sessions.large_requests.COLLECT_EVERY_S", 0.0)
    monkeypatch.setattr("impactcell.opcua.sessions.large_requests.gc.collect", lambda: rounds.append(1))
    async with line.turn(LARGE_BYTES):
        task = asyncio.ensure_future(line.collect_garbage())
        for _ in range(20):
            await asyncio.sleep(0)
        assert not rounds
    while len(rounds) < 2:
        await asyncio.sleep(0)
    task.cancel()


def test_the_interpreter_begins_no_full_round_by_itself() -> None:
    thresholds = gc.get_threshold()
    try:
        leave_full_rounds_to_the_server()
        assert gc.get_threshold() == (*thresholds[:2], NEVER)
    finally:
        gc.set_threshold(*thresholds)


async def test_few_listeners_are_told_at_once() -> None:
    told = list[int]()
    FanOut().deliver([told.append], 1)
    assert told == [1]


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "malloc_trim"), reason="a C library without malloc_trim")
def test_freed_memory_below_a_block_in_use_is_given_back() -> None:
    process = psutil.Process()
    blocks = [bytes(8000) for _ in range(10_000)]
    kept = blocks[:: len(blocks) // 10]
    held = process.memory_info().rss
    del blocks
    give_back_memory()
    assert process.memory_info().rss < held - 60_000_000
    assert sum(map(len, kept)) == 80_000
