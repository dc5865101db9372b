"""What the journal drops by age, and what of it nobody may miss: told once, and at the end of the service."""

from dataclasses import replace
from pathlib import Path

import pytest

from impactcell.errors import JournalFullError
from impactcell.journal.retention import Retention
from impactcell.journal.store import Journal
from impactcell.records import CycleId
from impactcell.service.journal_writer import JournalWriter
from tests.snapshots import make_capture, make_snapshot

SECOND = 10**9
DAY = 86_400 * SECOND
NOW = 10**18


def append(writer: JournalWriter, cycle: int, time_ns: int) -> None:
    capture = replace(make_capture(cycle, samples=10), time_ns=time_ns)
    snapshot = make_snapshot(capture)
    writer.cycle(CycleId(1, cycle), lambda journal: journal.append(capture, snapshot, b""))


def told(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records]


def test_a_clock_that_is_ahead_for_a_while_deletes_nothing_and_is_told_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("impactcell.service.journal_writer.PRUNE_EVERY", 1)
    writer = JournalWriter("c", Journal(tmp_path / "j", "c"), Retention())
    assert writer.journal is not None

    def come(first: int, begin_ns: int, count: int, every_ns: int) -> None:
        for number in range(count):
            time_ns = begin_ns + number * every_ns
            monkeypatch.setattr(
                "impactcell.service.journal_writer.time.time_ns", lambda now_ns=time_ns: now_ns
            )
            append(writer, first + number, time_ns)
            writer.maintain(time_ns)

    come(1, NOW, 10, SECOND)
    come(101, NOW + 400 * DAY, 5, SECOND)  # until it is set from the network
    assert writer.journal.count() == 15
    assert len(list(writer.journal.captures())) == 15
    (warning,) = told(caplog)
    assert "over 398 days after those before" in warning
    come(201, NOW + 400 * DAY, 15, 3600 * SECOND)  # or it is right, and the machine stood
    assert {capture.cycle for capture in writer.journal.captures()}.isdisjoint(range(1, 11))
    assert len(told(caplog)) == 1
    writer.close()


def test_what_still_waits_when_the_service_ends_is_written_or_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def full(*_: object) -> None:
        raise JournalFullError("the disk is full; make room")

    for is_free in (True, False):
        journal = Journal(tmp_path / f"{is_free}", "c")
        writer = JournalWriter("c", journal, Retention())
        with monkeypatch.context() as broken:
            broken.setattr(journal, "append", full)
            append(writer, 1, NOW)
            append(writer, 2, NOW + 1)
            if not is_free:
                assert writer.close() == 2
        if is_free:
            assert writer.close() == 0
        with Journal(tmp_path / f"{is_free}", "c", read_only=True) as kept:
            assert kept.count() == (2 if is_free else 0)
    (error,) = told(caplog)
    assert (
        "lost at the end of the service: 2; the disk is full; make room; cycles among them are read" in error
    )
