"""What makes room for what, and by whose clock something is old."""

import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest

from impactcell.journal.audit_entries import AuditEntry
from impactcell.journal.history import HistoryQuery
from impactcell.journal.retention import ROW_BYTES, SHARE, Retention
from impactcell.journal.store import Journal
from impactcell.records import Alarm
from tests.snapshots import make_capture, make_snapshot

SECOND = 10**9
DAY = 86_400 * SECOND
BEGIN = 10**18
SIZE = 2 * 2**20
MESSAGE = "press-1: 10.0.0.9:502 device 1: no connection within 0.5 s; check cable and address. " * 4


def came_and_went(number: int, time_ns: int) -> Alarm:
    active = bool(number % 2)
    return Alarm("ModuleConnection", active=active, time_ns=time_ns, activation=time_ns, message=MESSAGE)


def stored(path: Path, count: int) -> tuple[int, int, int, int]:
    database = sqlite3.connect(path)
    tables = ("cycles", "captures", "alarms", "audit")
    cycles, captures, alarms, audit = (
        database.execute(f"SELECT count(*) FROM {table}").fetchone()[0] for table in tables
    )
    database.close()
    assert cycles <= count
    return cycles, captures, alarms, audit


def filled(path: Path, cycles: int) -> Journal:
    """A journal of so many cycles, one a second."""
    journal = Journal(path, "c")
    journal._db.execute("PRAGMA synchronous = OFF")
    for cycle in range(cycles):
        capture = replace(make_capture(cycle, samples=10), time_ns=BEGIN + cycle * SECOND)
        journal.append(capture, make_snapshot(capture), b"")
    return journal


def pruned(journal: Journal, keep: Retention, active_ns: tuple[int, ...] = ()) -> None:
    while journal.prune(keep, BEGIN + DAY, active_ns):
        pass


@pytest.mark.slow
def test_alarms_that_come_and_go_push_out_no_cycle(tmp_path: Path) -> None:
    with filled(tmp_path / "j", 100) as journal:
        for burst in range(60):
            times = range(BEGIN + 200 * burst, BEGIN + 200 * (burst + 1))
            journal.record(b"", [came_and_went(number, number) for number in times])
        pruned(journal, Retention(max_size_bytes=SIZE))
        left = journal.alarms(HistoryQuery(limit=20_000)).entries
    most = int(SHARE * SIZE / ROW_BYTES)
    assert stored(tmp_path / "j", 100)[:2] == (100, 100)
    assert most <= len(left) < 12_000
    assert left[-1].time_ns == BEGIN + 11_999


def test_how_an_alarm_came_that_is_active_stays(tmp_path: Path) -> None:
    first_ns = BEGIN - 400 * DAY
    came = Alarm("WearLimit", active=True, time_ns=first_ns, activation=first_ns)
    over = Alarm("WearWarning", time_ns=first_ns + 1)
    with filled(tmp_path / "j", 10) as journal:
        journal.record(b"", [came, over])
        for keep in (Retention(), Retention(max_size_bytes=1)):
            pruned(journal, keep, (first_ns,))
            assert [alarm.name for alarm in journal.alarms(HistoryQuery()).entries] == [came.name]
        pruned(journal, Retention())
        assert journal.alarms(HistoryQuery()).entries == ()


def test_cycles_that_go_for_room_take_their_alarms_with_them_and_no_action(tmp_path: Path) -> None:
    action = AuditEntry(BEGIN, "anna", "Acknowledge", "{}", "Good")
    with filled(tmp_path / "j", 700) as journal:
        for second in (1, 690):
            journal.record(b"", [came_and_went(0, BEGIN + second * SECOND)], action)
        pruned(journal, Retention(max_size_bytes=200_000))
        (kept,) = journal.alarms(HistoryQuery()).entries
        assert kept.time_ns == BEGIN + 690 * SECOND
        assert journal.audit() == (action, action)
    cycles, captures, *_ = stored(tmp_path / "j", 700)
    assert (cycles < 700, captures) == (True, 0)


def test_actions_are_bounded_too(tmp_path: Path) -> None:
    action = AuditEntry(BEGIN, "anna", "Acknowledge", "x" * 500, "Good")
    with filled(tmp_path / "j", 10) as journal:
        for _ in range(400):
            journal.record(b"", (), action)
        pruned(journal, Retention(max_size_bytes=100 * ROW_BYTES))
        assert len(journal.audit()) == 100 * SHARE


def test_a_clock_that_is_ahead_makes_nothing_old_until_cycles_have_come_by_it_for_hours(
    tmp_path: Path,
) -> None:
    with filled(tmp_path / "j", 10) as journal:
        last_ns = BEGIN + 9 * SECOND
        assert journal.borne_out_ns(last_ns + DAY) == last_ns + DAY
        ahead_ns = last_ns + 400 * DAY
        for cycle in range(10):
            capture = replace(make_capture(100 + cycle, samples=10), time_ns=ahead_ns + cycle * SECOND)
            journal.append(capture, make_snapshot(capture), b"")
        assert journal.borne_out_ns(ahead_ns + 9 * SECOND) <= last_ns + 2 * DAY
        assert journal.borne_out_ns(last_ns + 3600 * SECOND) == last_ns + 3600 * SECOND
        hours_later_ns = ahead_ns + 7 * 3600 * SECOND  # a machine that has stood so long in truth
        assert journal.borne_out_ns(hours_later_ns) == hours_later_ns


def test_what_a_clock_that_is_behind_has_dated_is_no_older_than_what_was_stored_before_it(
    tmp_path: Path,
) -> None:
    """A module whose clock begins years ago after power-up, until somebody sets it."""
    long_ago_ns, today_ns = BEGIN - 4000 * DAY, BEGIN + DAY
    with filled(tmp_path / "j", 5) as journal:
        for cycle in range(100, 105):
            capture = replace(make_capture(cycle, samples=10), time_ns=long_ago_ns + cycle * SECOND)
            came = came_and_went(1, capture.time_ns)
            journal.append(capture, make_snapshot(capture), b"", [came])
        for cycle in range(105, 108):
            capture = replace(make_capture(cycle, samples=10), time_ns=today_ns - SECOND)
            journal.append(capture, make_snapshot(capture), b"")
        journal.prune(Retention(), today_ns)
        assert stored(tmp_path / "j", 13)[:3] == (13, 13, 5)
        journal.prune(Retention(), today_ns + 30 * DAY - 1800 * SECOND)  # of yesterday no capture is kept
        assert stored(tmp_path / "j", 13)[:3] == (13, 3, 5)
        journal.prune(Retention(), today_ns + 366 * DAY)
        assert stored(tmp_path / "j", 13)[:3] == (1, 0, 0)


def test_a_time_to_come_makes_no_cycle_behind_it_young(tmp_path: Path) -> None:
    capture = replace(make_capture(1, samples=10), time_ns=BEGIN + 10_000 * DAY)
    with Journal(tmp_path / "j", "c") as journal:
        journal.append(capture, make_snapshot(capture), b"")
        for cycle in range(2, 6):
            capture = replace(make_capture(cycle, samples=10), time_ns=BEGIN + cycle * SECOND)
            journal.append(capture, make_snapshot(capture), b"")
        journal.prune(Retention(), BEGIN + 400 * DAY)
        assert stored(tmp_path / "j", 5)[:2] == (2, 1)


def test_without_a_cycle_the_clock_is_all_there_is(tmp_path: Path) -> None:
    with Journal(tmp_path / "j", "c") as journal:
        assert journal.borne_out_ns(BEGIN) == BEGIN
