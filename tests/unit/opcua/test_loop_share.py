"""Whoever asks for much waits for turns, one in a round of the loop; what many hear is told in slices."""

import asyncio
import itertools
from types import SimpleNamespace

import pytest

from impactcell.opcua.fan_out import FanOut
from impactcell.opcua.loop_share import SLICE_S, LoopShare, Turns

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
    fan_out, told = FanOut(), [list[int]() for _ in range(500)]
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
    assert rounds >= 501 / (PIECES + 1)


async def test_few_listeners_are_told_at_once() -> None:
    told = list[int]()
    FanOut().deliver([told.append], 1)
    assert told == [1]
