"""What was committed is there, with its state; what was not has left no trace."""

import contextlib
import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest

from impactcell.errors import ForeignJournalError, JournalDamagedError, JournalError, JournalFullError
from impactcell.journal import database, schema
from impactcell.journal.audit_entries import AuditEntry
from impactcell.journal.checksums import row_crc
from impactcell.journal.history import HistoryQuery
from impactcell.journal.retention import FREE_SHARE, Retention
from impactcell.journal.store import Journal
from impactcell.quantities import BY_COLUMN
from impactcell.records import Alarm, CycleId
from impactcell.records.quantity import DataType
from tests.snapshots import make_capture, make_snapshot


def append(journal: Journal, cycle: int, *, session: int = 1, samples: int = 200) -> None:
    capture = make_capture(cycle, session, samples)
    journal.append(capture, make_snapshot(capture), f"state {cycle}".encode())


def append_many(journal: Journal, cycles: range) -> None:
    for cycle in cycles:
        append(journal, cycle, samples=4000)


def test_cycle_capture_and_state_come_back_after_reopening(tmp_path: Path) -> None:
    path = tmp_path / "cell.sqlite"
    with Journal(path, "press-1") as journal:
        assert journal.state() is None
        assert journal.last_cycle_id() is None
        append(journal, 1)
        append(journal, 2)
    with Journal(path, "press-1") as journal:
        assert journal.state() == b"state 2"
        assert journal.last_cycle_id() == CycleId(1, 2)
        first, second = journal.captures()
        assert (first.cycle, second.cycle) == (1, 2)
        assert [capture.cycle for capture in journal.captures(2, 2)] == [2]


def test_a_flag_of_a_cycle_comes_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A published Boolean with a column was a KeyError at the import of the journal."""
    Journal(tmp_path / "j", "c").close()
    flag = replace(BY_COLUMN["batch_id"], data_type=DataType.BOOLEAN, value=lambda s: s.cycle > 1)
    monkeypatch.setattr(schema, "BY_COLUMN", {**BY_COLUMN, "flag": flag})
    columns = schema._columns()
    cells = tuple((c.name, schema._STORED_FORMS[c.sql_type], c.of) for c in columns)
    monkeypatch.setattr(database, "COLUMNS", columns)
    monkeypatch.setattr(schema, "_CELLS", cells)
    with Journal(tmp_path / "j", "c") as journal:
        append(journal, 1)
        append(journal, 2)
    with contextlib.closing(sqlite3.connect(tmp_path / "j")) as opened:
        flags = [bool(value) for (value,) in opened.execute("SELECT flag FROM cycles ORDER BY seq")]
    assert flags == [False, True]


def test_a_cycle_is_stored_once(tmp_path: Path) -> None:
    with Journal(tmp_path / "j", "c") as journal:
        append(journal, 1)
        with pytest.raises(JournalError, match="stored already"):
            append(journal, 1)
        assert journal.state() == b"state 1"
        append(journal, 1, session=2)
        assert journal.last_cycle_id() == CycleId(2, 1)
    with Journal(tmp_path / "j", "c") as journal, pytest.raises(JournalError, match="stored already"):
        append(journal, 1, session=2)


def test_cycle_numbers_may_come_again(tmp_path: Path) -> None:
    """A module that starts anew in the same session, and a counter that wraps."""
    numbers = [1, 2, 3, 1, 2, 2**32 - 1, 1]
    with Journal(tmp_path / "j", "c") as journal:
        for number in numbers:
            append(journal, number)
        assert [capture.cycle for capture in journal.captures()] == numbers
        assert journal.last_cycle_id() == CycleId(1, 1)


def test_a_state_that_is_replaced_is_not_written_over_as_well(tmp_path: Path) -> None:
    state, log = bytes(200_000), tmp_path / "j-wal"
    with Journal(tmp_path / "j", "c") as journal:
        journal.record(state)
        before = log.stat().st_size
        journal.record(state)
        assert log.stat().st_size - before < 1.3 * len(state)


def test_a_failed_append_leaves_nothing_behind(tmp_path: Path) -> None:
    with Journal(tmp_path / "j", "c") as journal:
        append(journal, 1)
        pages = journal._db.execute("PRAGMA page_count").fetchone()[0]
        journal._db.execute(f"PRAGMA max_page_count = {pages}")
        with pytest.raises(JournalFullError, match="make room"):
            append_many(journal, range(2, 50))
        stored = [capture.cycle for capture in journal.captures()]
        last = journal.last_cycle_id()
        assert last is not None
        assert journal.state() == f"state {last.cycle}".encode()
        assert stored == list(range(1, last.cycle + 1))
        journal._db.execute("PRAGMA max_page_count = 1000000")
        append(journal, last.cycle + 1)
        assert journal.last_cycle_id() == CycleId(1, last.cycle + 1)


def test_actions_are_audited_with_their_state(tmp_path: Path) -> None:
    entry = AuditEntry(5, "anna", "ResetWear", '{"Comment": "new plate"}', "Good")
    with Journal(tmp_path / "j", "c") as journal:
        append(journal, 1)
        journal.record(b"after reset", [Alarm("WearLimit", time_ns=5)], entry)
        assert journal.audit() == (entry,)
        assert journal.state() == b"after reset"


@pytest.mark.parametrize(
    "content",
    [
        b"not a database at all" * 100,
        b"\n",
        b"SQLite format 3\0",
        None,
        "other version",
        "other cell",
        "no cell",
    ],
)
def test_foreign_files_are_refused_and_left_alone(tmp_path: Path, content: bytes | str | None) -> None:
    path = tmp_path / "j"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is None:
        with sqlite3.connect(path) as db:
            db.execute("CREATE TABLE theirs (x)")
        db.close()
    else:
        Journal(path, "other").close()
        if content == "other version":
            db = sqlite3.connect(path)
            db.execute("PRAGMA user_version = 99")
            db.close()
        if content == "no cell":
            with sqlite3.connect(path) as db:
                db.execute("DELETE FROM meta")
            db.close()
    before = path.read_bytes()
    with pytest.raises(ForeignJournalError):
        Journal(path, "press-1")
    assert path.read_bytes() == before


def test_a_foreign_database_in_use_is_left_to_its_program(tmp_path: Path) -> None:
    path, log = tmp_path / "j", tmp_path / "j-wal"
    theirs = sqlite3.connect(tmp_path / "theirs")
    theirs.execute("PRAGMA journal_mode = WAL")
    theirs.execute("CREATE TABLE theirs (x)")
    path.write_bytes((tmp_path / "theirs").read_bytes())
    log.write_bytes((tmp_path / "theirs-wal").read_bytes())
    theirs.close()
    before = path.read_bytes(), log.read_bytes()
    with pytest.raises(ForeignJournalError):
        Journal(path, "press-1")
    assert (path.read_bytes(), log.read_bytes()) == before


def test_a_journal_without_a_table_is_no_full_disk(tmp_path: Path) -> None:
    path = tmp_path / "j"
    Journal(path, "c").close()
    with sqlite3.connect(path) as db:
        db.execute("DROP TABLE meta")
    db.close()
    with pytest.raises(JournalError, match="no such table: meta") as told:
        Journal(path, "c")
    assert not told.value.retry


def test_a_damaged_file_gives_what_is_whole_and_then_says_so(tmp_path: Path) -> None:
    path = tmp_path / "j"
    with Journal(path, "c") as journal:
        append_many(journal, range(1, 40))
    data = bytearray(path.read_bytes())
    middle = slice(3 * len(data) // 4, 3 * len(data) // 4 + 4 * 4096)
    data[middle] = b"\xff" * len(data[middle])
    path.write_bytes(data)
    read: list[int] = []
    with Journal(path, "c", read_only=True) as journal, pytest.raises(JournalError, match="damaged"):
        read.extend(capture.cycle for capture in journal.captures())
    assert read == list(range(1, len(read) + 1))
    assert 0 < len(read) < 39


NUMBERS = {"cycles": "seq", "alarms": "id", "audit": "id"}


@pytest.fixture
def numbered(tmp_path: Path) -> Path:
    """A journal with three rows in each table that is in the order of its numbers."""
    with Journal(tmp_path / "j", "c") as journal:
        for number in (1, 2, 3):
            append(journal, number)
            alarm = Alarm("WearLimit", cycle=number, time_ns=number)
            journal.record(b"state", (alarm,), AuditEntry(number, "ann", f"action {number}", "", "done"))
    return tmp_path / "j"


def orders(path: Path) -> dict[str, list[int]]:
    with Journal(path, "c", read_only=True) as journal:
        last = journal.last_cycle_id()
        return {
            "cycles": [0 if last is None else last.cycle],
            "alarms": [alarm.cycle for alarm in journal.alarms(HistoryQuery()).entries],
            "audit": [entry.time_ns for entry in journal.audit()],
        }


@pytest.mark.parametrize("table", NUMBERS)
def test_a_row_with_another_number_is_not_put_in_another_place(numbered: Path, table: str) -> None:
    """As one changed bit in the number of the second row leaves it, which SQLite takes as it comes."""
    whole = orders(numbered)
    assert whole == {"cycles": [3], "alarms": [1, 2, 3], "audit": [1, 2, 3]}
    with sqlite3.connect(numbered) as db:
        db.execute(f"UPDATE {table} SET {NUMBERS[table]} = 66 WHERE {NUMBERS[table]} = 2")
    db.close()
    assert orders(numbered) == whole | ({} if table == "cycles" else {table: [1, 3]})


def test_rows_of_format_5_have_checksums_without_their_numbers(numbered: Path) -> None:
    whole = orders(numbered)
    with sqlite3.connect(numbered) as db:
        for table, key in NUMBERS.items():
            for row in db.execute(f"SELECT * FROM {table}").fetchall():
                db.execute(f"UPDATE {table} SET crc = ? WHERE {key} = ?", (row_crc(row[1:-1]), row[0]))
        db.execute("PRAGMA user_version = 5")
    db.close()
    Journal(numbered, "c").close()
    assert orders(numbered) == whole


@pytest.mark.parametrize(
    ("text", "read_only"), [(b"CREATE TABLE", True), (b"CREATE TABLE", False), (b"batch_offset_std", False)]
)
def test_text_of_the_schema_that_is_no_utf_8_is_damage(numbered: Path, text: bytes, read_only: bool) -> None:
    data = numbered.read_bytes()
    assert text in data
    numbered.write_bytes(data.replace(text, text[:3] + bytes([text[3] | 0x80]) + text[4:]))
    with pytest.raises(JournalDamagedError, match="is damaged"), Journal(numbered, "c", read_only=read_only):
        pass


def test_text_of_a_row_that_is_no_utf_8_costs_that_row_alone(numbered: Path) -> None:
    data = numbered.read_bytes()
    numbered.write_bytes(data.replace(b"action 2", b"acti\xefn 2"))
    assert orders(numbered) == {"cycles": [3], "alarms": [1, 2, 3], "audit": [1, 3]}


def test_the_model_is_kept_beside_the_captures(tmp_path: Path) -> None:
    with Journal(tmp_path / "j", "c") as journal:
        assert journal.model == ""
        journal.store_model("first")
        journal.store_model("second")
    with Journal(tmp_path / "j", None, read_only=True) as journal:
        assert journal.model == "second"


def test_missing_directory_is_named(tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="nowhere"):
        Journal(tmp_path / "nowhere" / "j", "c")
    with pytest.raises(JournalError, match="no such journal"):
        Journal(tmp_path / "j", None, read_only=True)


def test_captures_are_thinned_before_cycles(tmp_path: Path) -> None:
    with Journal(tmp_path / "j", "c") as journal:
        for cycle in range(1, 301):
            append(journal, cycle, samples=1000)
        size = 400_000
        journal.prune(Retention(max_size_bytes=size), now_ns=make_capture(300).time_ns)
        kept = [capture.cycle for capture in journal.captures()]
        assert kept
        assert kept[-1] == 300
        assert len(kept) < 300
        assert journal._db.execute("SELECT count(*) FROM cycles").fetchone() == (300,)
        pages, page_size = (
            journal._db.execute(f"PRAGMA {p}").fetchone()[0] for p in ("page_count", "page_size")
        )
        assert pages * page_size <= (1.0 - FREE_SHARE) * size


def test_age_drops_captures_then_cycles_but_never_the_last(tmp_path: Path) -> None:
    day_ns = 86_400 * 10**9
    with Journal(tmp_path / "j", "c") as journal:
        for cycle in (1, 2, 3):
            append(journal, cycle)
        now_ns = make_capture(3).time_ns
        journal.prune(Retention(days=10, captures_days=5), now_ns + 6 * day_ns)
        assert list(journal.captures()) == []
        assert journal.last_cycle_id() == CycleId(1, 3)
        journal.prune(Retention(days=10, captures_days=5), now_ns + 11 * day_ns)
        assert journal._db.execute("SELECT cycle FROM cycles").fetchall() == [(3,)]
        assert journal.state() == b"state 3"


def test_what_has_no_time_is_of_no_age_but_takes_room(tmp_path: Path) -> None:
    with Journal(tmp_path / "j", "c") as journal:
        for cycle in (1, 2, 3):
            capture = replace(make_capture(cycle), time_ns=0) if cycle == 2 else make_capture(cycle)
            journal.append(capture, make_snapshot(capture), b"state", [Alarm("WearLimit")])
        now_ns = make_capture(3).time_ns + 11 * 86_400 * 10**9
        journal.prune(Retention(days=10, captures_days=5), now_ns)
        assert [capture.cycle for capture in journal.captures()] == [2]
        assert journal._db.execute("SELECT cycle FROM cycles").fetchall() == [(2,), (3,)]
        assert len(journal.alarms(HistoryQuery(None, None, 10)).entries) == 3
        journal.prune(Retention(max_size_bytes=1), now_ns)
        assert journal._db.execute("SELECT cycle FROM cycles").fetchall() == [(3,)]


def test_a_capture_goes_with_its_cycle(tmp_path: Path) -> None:
    with Journal(tmp_path / "j", "c") as journal:
        for cycle in (1, 2, 3):
            append(journal, cycle)
        now_ns = make_capture(3).time_ns
        journal.prune(Retention(days=10, captures_days=30), now_ns + 11 * 86_400 * 10**9)
        assert journal._db.execute("SELECT count(*) FROM captures").fetchone() == (0,)


@pytest.mark.slow
@pytest.mark.parametrize("keep", [Retention(days=1, captures_days=1), Retention(max_size_bytes=1)])
def test_no_call_drops_everything_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, keep: Retention
) -> None:
    monkeypatch.setattr("impactcell.journal.retention.PRUNE_LIMIT", 128)
    with Journal(tmp_path / "j", "c") as journal:
        for cycle in range(1, 301):
            append(journal, cycle, samples=10)
        now_ns = make_capture(300).time_ns + 2 * 86_400 * 10**9
        left = [300]
        while journal.prune(keep, now_ns):
            left.append(len(list(journal.captures())))
        assert left[:3] == [300, 172, 44]
        assert list(journal.captures()) == []
        assert journal._db.execute("SELECT cycle FROM cycles").fetchall() == [(300,)]


def test_what_is_no_database_is_not_read_as_a_journal(tmp_path: Path) -> None:
    text = tmp_path / "text"
    text.write_bytes(b"nothing of a database\n" * 200)
    with pytest.raises(ForeignJournalError, match="it is left as it is"):
        Journal(text, None, read_only=True)
    assert text.read_bytes() == b"nothing of a database\n" * 200
