"""The past is read in a process of its own: page by page, whoever stops waiting, whatever happens to it."""

import asyncio
import os
import signal
from collections.abc import AsyncIterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace

import pytest

from impactcell.journal.store import Journal
from impactcell.opcua.history.historical_variable import parse_read_range
from impactcell.records import Alarm, Quality
from impactcell.scada import HistoryRequest, RefusedError
from impactcell.service.history_source import ALARMS_AT_ONCE, VALUES_AT_ONCE, JournalHistory
from tests.patience import PATIENCE_S
from tests.snapshots import make_capture, make_snapshot

pytestmark = pytest.mark.slow

CELL, VARIABLE = "press-1", "Friction/StaticFriction"
COUNT = 2 * VALUES_AT_ONCE + 10


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("past") / "j"
    with Journal(path, CELL) as journal:
        journal._db.execute("PRAGMA synchronous = OFF")  # made for this test alone
        for cycle in range(1, COUNT + 1):
            capture = replace(make_capture(cycle, samples=8), time_ns=cycle)
            alarms = [Alarm("WearLimit", cycle=cycle, time_ns=cycle)] if cycle <= ALARMS_AT_ONCE + 3 else []
            journal.append(capture, make_snapshot(capture, cycle / COUNT), b"", alarms)
    return path


def cell(file: Path | None) -> object:
    journal = None if file is None else SimpleNamespace(file=file)
    return SimpleNamespace(cell=SimpleNamespace(settings=SimpleNamespace(journal=journal)))


@pytest.fixture
async def history(file: Path) -> AsyncIterator[JournalHistory]:
    source = JournalHistory({CELL: cell(file), "none": cell(None), "gone": cell(file / "nowhere")})
    yield source
    await source.close()


async def test_pages_are_small_and_join_to_the_whole(history: JournalHistory) -> None:
    request, times = HistoryRequest(2, COUNT - 1, 10_000), list[int]()
    while True:
        page = await history.values(CELL, VARIABLE, request)
        assert len(page.values) <= VALUES_AT_ONCE
        assert all(v.value == v.time_ns / COUNT and v.quality is Quality.GOOD for v in page.values)
        times += [value.time_ns for value in page.values]
        if page.resume is None:
            break
        request = replace(request, resume=page.resume)
    assert times == list(range(2, COUNT))


def new_year(year: int) -> datetime:
    return datetime(year, 1, 1, tzinfo=UTC)


async def test_alarms(history: JournalHistory) -> None:
    page = await history.alarms(CELL, HistoryRequest(None, None, 1000, newest_first=True))
    assert [alarm.cycle for alarm in page.alarms] == list(range(ALARMS_AT_ONCE + 3, 3, -1))
    rest = await history.alarms(CELL, HistoryRequest(None, None, 1000, newest_first=True, resume=page.resume))
    assert [alarm.cycle for alarm in rest.alarms] == [3, 2, 1]
    assert rest.resume is None


@pytest.mark.parametrize("late", [datetime.max.replace(tzinfo=UTC), *map(new_year, (2263, 2400, 2600))])
@pytest.mark.parametrize("early", [new_year(1602), new_year(1970)])
async def test_an_end_beyond_what_a_journal_can_hold_is_open(
    history: JournalHistory, early: datetime, late: datetime
) -> None:
    """DateTime.MaxValue as the end was an internal error; after 2262 the journal was said to be unusable."""
    for start, end, newest_first in ((early, late, False), (late, early, True)):
        wanted = parse_read_range(start, end, 3)
        assert wanted.newest_first is newest_first
        page = await history.values(CELL, VARIABLE, wanted.request(3))
        times = [value.time_ns for value in page.values]
        assert times == ([COUNT, COUNT - 1, COUNT - 2] if newest_first else [1, 2, 3])
        assert (await history.alarms(CELL, wanted.request(3))).alarms
    assert not (await history.values(CELL, VARIABLE, parse_read_range(late, None, 3).request(3))).values
    assert (await history.values(CELL, VARIABLE, parse_read_range(None, late, 3).request(3))).values
    both = parse_read_range(late, late, 3)
    assert not (await history.values(CELL, VARIABLE, both.request(3))).values


async def test_a_question_that_nobody_waits_for_leaves_the_next_its_answer(history: JournalHistory) -> None:
    ask = [
        asyncio.create_task(history.values(CELL, VARIABLE, HistoryRequest(time, time, 1)))
        for time in range(1, 21)
    ]
    await asyncio.sleep(0)
    for task in ask[::2]:
        task.cancel()
    given = await asyncio.gather(*ask, return_exceptions=True)
    assert all(isinstance(answer, asyncio.CancelledError) for answer in given[::2])
    assert [answer.values[0].time_ns for answer in given[1::2]] == list(range(2, 21, 2))


async def test_a_process_that_ends_is_begun_anew(history: JournalHistory) -> None:
    request = HistoryRequest(None, None, 1)
    await history.values(CELL, VARIABLE, request)
    process = history._process
    assert process is not None
    os.kill(process.pid, signal.SIGKILL)
    await process.wait()
    with pytest.raises(RefusedError, match="cannot be read now"):
        await history.values(CELL, VARIABLE, request)
    assert (await history.values(CELL, VARIABLE, request)).values


async def test_the_process_ends_with_its_service(history: JournalHistory) -> None:
    await history.values(CELL, VARIABLE, HistoryRequest(None, None, 1))
    process = history._process
    assert process is not None
    assert process.stdin is not None
    process.stdin.close()  # as the system does it for a service that was killed
    assert await asyncio.wait_for(process.wait(), PATIENCE_S) == 0


async def test_what_has_no_past(history: JournalHistory) -> None:
    request = HistoryRequest(None, None, 1)
    assert not (await history.values("none", VARIABLE, request)).values
    assert not (await history.alarms("none", request)).alarms
    for cell_name, variable in (("gone", VARIABLE), ("unknown", VARIABLE), (CELL, "Friction/PeakForce")):
        with pytest.raises(RefusedError):
            await history.values(cell_name, variable, request)
    assert (await history.values(CELL, VARIABLE, request)).values
