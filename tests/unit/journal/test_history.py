"""Pages of the past, put together, are the past: nothing twice, nothing missing, in order."""

import io
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.errors import JournalError
from impactcell.journal.history import HistoryQuery, Page, StoredValue
from impactcell.journal.history_reader import LENGTH, Answer, Question, serve
from impactcell.journal.store import Journal
from impactcell.records import Alarm, Coefficient, Evidence, Quality
from tests.snapshots import make_capture, make_snapshot

CYCLES = 40


@pytest.fixture(scope="module")
def journal(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Journal]:
    with Journal(tmp_path_factory.mktemp("j") / "j", "c") as journal:
        for cycle in range(CYCLES):
            # Several cycles share a time, and the clock goes back once.
            capture = replace(make_capture(cycle, samples=8), time_ns=1000 + cycle // 3 - 5 * (cycle > 30))
            snapshot = make_snapshot(capture, mu_s=cycle / 100)
            if cycle == 7:
                bad = replace(snapshot.friction, mu_s=Coefficient(quality=Quality.BAD, reason="clipped"))
                snapshot = replace(snapshot, friction=bad)
            alarm = Alarm("WearLimit", time_ns=capture.time_ns, cycle=cycle, evidence=Evidence(size=math.inf))
            journal.append(capture, snapshot, b"", [alarm] if cycle % 4 == 0 else [])
        yield journal


def read_all(journal: Journal, question: HistoryQuery) -> list[StoredValue]:
    entries: list[StoredValue] = []
    while True:
        page: Page[StoredValue] = journal.values("Friction/StaticFriction", question)
        assert len(page.entries) <= question.limit
        entries += page.entries
        if page.resume is None:
            return entries
        question = replace(question, resume=page.resume)


bounds = st.none() | st.integers(990, 1020)


@given(bounds, bounds, st.integers(1, 50), st.booleans())
@settings(max_examples=60, deadline=None)
def test_pages_join_to_the_whole(
    journal: Journal, start: int | None, end: int | None, limit: int, newest_first: bool
) -> None:
    whole = [(1000 + c // 3 - 5 * (c > 30), c) for c in range(CYCLES)]
    wanted = sorted((t, c) for t, c in whole if (start is None or t >= start) and (end is None or t <= end))
    got = read_all(journal, HistoryQuery(start, end, limit, newest_first))
    expected = wanted[::-1] if newest_first else wanted
    assert [entry.time_ns for entry in got] == [t for t, _ in expected]
    for entry, (_, cycle) in zip(got, expected, strict=True):
        if cycle == 7:
            assert math.isnan(entry.value)
            assert entry.quality is Quality.BAD
        else:
            assert entry.value == cycle / 100


def test_alarms_come_back_whole(journal: Journal) -> None:
    page = journal.alarms(HistoryQuery(limit=3))
    assert page.resume is not None
    assert page.entries[0].evidence.size == math.inf
    rest = journal.alarms(HistoryQuery(limit=100, resume=page.resume))
    assert len(page.entries) + len(rest.entries) == CYCLES // 4
    assert rest.resume is None


def test_what_has_no_past_is_said(journal: Journal) -> None:
    with pytest.raises(JournalError, match="Friction/StaticFriction"):
        journal.values("Friction/PeakForce", HistoryQuery())
    with pytest.raises(JournalError, match="token"):
        journal.values("Wear/Level", HistoryQuery(resume=b"x"))


def test_questions_from_another_process_are_answered_in_turn(journal: Journal, tmp_path: Path) -> None:
    """As the journal itself answers them; half a question, as a process leaves that dies, ends it."""
    nobody = str(tmp_path / "nobody.sqlite")
    variable = "Friction/StaticFriction"
    asked = [
        Question(str(journal.path), variable, HistoryQuery(limit=5)),
        Question(nobody, variable, HistoryQuery()),
        Question(str(journal.path), "", HistoryQuery(limit=3)),
    ]
    documents = [msgspec.msgpack.encode(question) for question in asked]
    sent = b"".join(LENGTH.pack(len(one)) + one for one in documents) + LENGTH.pack(7)[:2]
    out = io.BytesIO()
    serve(io.BytesIO(sent), out)
    out.seek(0)
    answers = []
    while head := out.read(LENGTH.size):
        answers.append(msgspec.msgpack.decode(out.read(*LENGTH.unpack(head)), type=Answer))
    values, missing, alarms = answers
    page = journal.values(variable, asked[0].query)
    assert values.times_ns == [entry.time_ns for entry in page.entries]
    assert values.values == [entry.value for entry in page.entries]
    assert values.resume == page.resume
    assert nobody in missing.error
    assert (len(alarms.alarms), alarms.error) == (3, "")
