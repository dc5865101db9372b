"""A journal of an earlier version is brought up to this one, all or nothing, wherever it is interrupted."""

import math
import shutil
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from impactcell.errors import ForeignJournalError, JournalFullError
from impactcell.journal.history import HistoryQuery
from impactcell.journal.schema import FORMAT
from impactcell.journal.store import Journal
from impactcell.journal.stored_forms import STATE, upgraded_state
from impactcell.serialization.message_pack import pack_tree, unpack_tree
from tests.snapshots import make_capture, make_snapshot

DATA = Path(__file__).parents[2] / "data"
CELL = "press-1"

KILLED = """
import os, signal, sqlite3, sys
from pathlib import Path
from impactcell.journal import database
from impactcell.journal.store import Journal
from impactcell.journal.stored_forms import upgraded_state

def killed_at(statement, path):
    connect, seen = sqlite3.connect, 0

    def traced(*arguments, **options):
        def count(sql):
            nonlocal seen
            if seen == statement:
                os.kill(os.getpid(), signal.SIGKILL)
            seen += 1
        opened = connect(*arguments, **options)
        opened.set_trace_callback(count)
        return opened

    database.sqlite3.connect = traced
    Journal(path, "press-1", upgrade=upgraded_state)
    os._exit(0)  # no more statements than that

directory = Path(sys.argv[1])
for statement in range(1000):
    path = directory / str(statement) / "j.sqlite"
    path.parent.mkdir()
    path.write_bytes(Path(sys.argv[2]).read_bytes())
    if not (child := os.fork()):
        killed_at(statement, path)
    status = os.waitpid(child, 0)[1]
    if os.WIFEXITED(status):
        sys.exit(os.WEXITSTATUS(status))
"""


@pytest.fixture
def older(tmp_path: Path) -> Path:
    """A journal as format 3 left it."""
    path = tmp_path / "j.sqlite"
    shutil.copy(DATA / "journal-format-3.sqlite", path)
    return path


def rows(path: Path, table: str) -> list[tuple[object, ...]]:
    database = sqlite3.connect(path)
    try:
        return database.execute(f"SELECT * FROM {table}").fetchall()
    finally:
        database.close()


def version(path: Path) -> int:
    database = sqlite3.connect(path)
    try:
        return int(database.execute("PRAGMA user_version").fetchone()[0])
    finally:
        database.close()


TABLES = ("meta", "cycles", "captures", "alarms", "audit")


def test_the_state_is_written_anew_and_what_it_was_before_is_kept(older: Path) -> None:
    before = {table: rows(older, table) for table in (*TABLES, "state")}
    Journal(older, CELL, upgrade=upgraded_state).close()
    assert version(older) == FORMAT
    for table in TABLES:  # a quantity that is published since adds a column at the end
        width = max(map(len, before[table]), default=0)
        assert [row[:width] for row in rows(older, table)] == before[table], table
    ((_, seq, blob),) = before["state"]
    assert rows(older, "earlier_states") == [(1, seq, blob)]
    ((_, seq_now, blob_now, _),) = rows(older, "state")
    assert seq_now == seq
    assert not STATE.is_older(blob_now)
    Journal(older, CELL, upgrade=upgraded_state).close()
    assert len(rows(older, "earlier_states")) == 1


def test_a_quantity_that_was_not_published_then_gets_its_column(older: Path) -> None:
    kept = [row[1:] for row in rows(older, "cycles")]
    database = sqlite3.connect(older)
    database.execute("ALTER TABLE cycles DROP COLUMN wear_level")
    database.close()
    with Journal(older, CELL, upgrade=upgraded_state) as journal:
        first = make_capture(time_ns=2 * 10**18)
        journal.append(first, make_snapshot(first), b"state")
        page = journal.values("Wear/Level", HistoryQuery(newest_first=True, limit=2))
    assert [value.value for value in page.entries][:1] == [make_snapshot(first).wear.level]
    assert math.isnan(page.entries[1].value), "from before it was kept"
    assert len(rows(older, "cycles")) == len(kept) + 1


def test_reading_alone_changes_nothing(older: Path) -> None:
    before = older.read_bytes()
    with Journal(older, CELL, read_only=True) as journal:
        assert len(journal.alarms(HistoryQuery()).entries) == len(rows(older, "alarms"))
        assert STATE.is_older(journal.state() or b"")
    assert older.read_bytes() == before
    assert version(older) == 3


@pytest.mark.slow
def test_killed_at_any_statement_it_is_as_it_was_or_as_it_will_be(tmp_path: Path, older: Path) -> None:
    images = tmp_path / "killed"
    images.mkdir()
    done = subprocess.run(
        [sys.executable, "-c", KILLED, str(images), str(older)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    whole = tmp_path / "whole.sqlite"
    shutil.copy(older, whole)
    Journal(whole, CELL, upgrade=upgraded_state).close()
    kept = {table: rows(whole, table) for table in (*TABLES, "state", "earlier_states")}
    before = rows(older, "state")
    outcomes = []
    for image in sorted(images.iterdir(), key=lambda directory: int(directory.name)):
        path = image / "j.sqlite"
        outcomes.append((version(path), rows(path, "state")))  # as SQLite finds it after the crash
        Journal(path, CELL, upgrade=upgraded_state).close()
        assert {table: rows(path, table) for table in kept} == kept
    assert [outcome for outcome in outcomes if outcome not in ((3, before), (FORMAT, kept["state"]))] == []
    assert {number for number, _ in outcomes} == {3, FORMAT}
    assert len(outcomes) > 10


def test_a_full_disk_leaves_it_as_it_was(older: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    connect = sqlite3.connect
    before = older.read_bytes()

    def full(*arguments: object, **options: object) -> sqlite3.Connection:
        database: sqlite3.Connection = connect(*arguments, **options)  # type: ignore[call-overload]
        pages = database.execute("PRAGMA page_count").fetchone()[0]
        database.execute(f"PRAGMA max_page_count = {pages}")
        return database

    with monkeypatch.context() as patched:
        patched.setattr("impactcell.journal.database.sqlite3.connect", full)
        with pytest.raises(JournalFullError, match="make room") as told:
            Journal(older, CELL, upgrade=upgraded_state)
    assert told.value.retry
    assert older.read_bytes() == before
    Journal(older, CELL, upgrade=upgraded_state).close()
    assert version(older) == FORMAT


def replaced(path: Path, blob: bytes) -> None:
    database = sqlite3.connect(path)
    with database:
        database.execute("UPDATE state SET blob = ?", (blob,))
        if len(rows(path, "state")[0]) > 3:
            database.execute("UPDATE state SET crc = NULL")  # as written before rows had one
    database.close()


def later(blob: bytes) -> bytes:
    return pack_tree({"format": STATE.format + 3, "content": unpack_tree(blob)})


def strange(blob: bytes) -> bytes:
    stored = unpack_tree(blob)
    stored.get("content", stored)["temperature"] = 20.0
    return pack_tree(stored)


def damaged(blob: bytes) -> bytes:
    return blob[: len(blob) // 2]


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (later, f"the state is of format {STATE.format + 3}, this version knows up to {STATE.format}"),
        (strange, "it holds 'temperature', which this version does not know"),
        (damaged, "the state cannot be read: damaged"),
    ],
)
@pytest.mark.parametrize("brought_up", [False, True])
def test_a_state_that_cannot_be_read_is_refused_and_left_as_it_is(
    older: Path, change, why: str, brought_up: bool
) -> None:
    if brought_up:
        Journal(older, CELL, upgrade=upgraded_state).close()
    ((_, _, blob, *_),) = rows(older, "state")
    replaced(older, change(blob))
    before, number = older.read_bytes(), version(older)
    with pytest.raises(ForeignJournalError) as told:
        Journal(older, CELL, upgrade=upgraded_state)
    assert older.read_bytes() == before
    assert version(older) == number
    for words in (
        str(older),
        f"cell '{CELL}' is left as it is",
        why,
        "run the version that wrote it, or name another",
    ):
        assert words in str(told.value)
    assert not told.value.retry


@pytest.mark.parametrize("number", [2, FORMAT + 1])
def test_a_file_of_a_format_that_is_not_known_is_refused_with_the_way_out(older: Path, number: int) -> None:
    database = sqlite3.connect(older)
    database.execute(f"PRAGMA user_version = {number}")
    database.close()
    before = older.read_bytes()
    for read_only in (True, False):
        with pytest.raises(ForeignJournalError) as told:
            Journal(older, CELL, read_only=read_only, upgrade=upgraded_state)
        assert f"cell '{CELL}' has format {number}, this version of the program knows 3 to {FORMAT}" in str(
            told.value
        )
        assert "name another file" in str(told.value)
    assert older.read_bytes() == before
