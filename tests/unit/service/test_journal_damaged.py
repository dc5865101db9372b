"""Damage on the disk: the rest is read, the damage is named, and the cell runs on. Truth: what was stored."""

import shutil
import sqlite3
from pathlib import Path

import numpy as np
import pytest

from impactcell import cell as core
from impactcell.campaign import read
from impactcell.cli.export import export
from impactcell.errors import JournalDamagedError, JournalError
from impactcell.journal.audit_entries import AuditEntry
from impactcell.journal.history import HistoryQuery
from impactcell.journal.retention import Retention
from impactcell.journal.store import Journal
from impactcell.records import CycleId
from impactcell.service.journal_writer import open_journal
from impactcell.service.worker import CellWorker
from tests.snapshots import make_capture, make_snapshot
from tests.unit.service.test_worker import cycles, design, process

__all__ = ["design"]

PAGE = 4096


def filled(path: Path, number: int = 12) -> None:
    with Journal(path, "c") as journal:
        for cycle in range(1, number + 1):
            capture = make_capture(cycle)
            journal.append(capture, make_snapshot(capture), b"state")
        journal.record(b"state", audit=AuditEntry(1, "anna", "ResetWear", "{}", "Good"))


def flip(path: Path, table: str, column: str, number: int) -> None:
    """Change one bit of a value, as a disk would: SQLite does not see it."""
    database = sqlite3.connect(path)
    with database:
        key = "seq" if table in ("cycles", "captures") else "id"
        [value] = database.execute(f"SELECT {column} FROM {table} WHERE {key} = ?", (number,)).fetchone()
        if isinstance(value, int):
            value ^= 1
        elif isinstance(value, float):
            value = float(np.nextafter(value, np.inf))
        elif isinstance(value, str):
            value = chr(ord(value[0]) ^ 1) + value[1:]
        else:
            value = value[:-1] + bytes([value[-1] ^ 1])
        database.execute(f"UPDATE {table} SET {column} = ? WHERE {key} = ?", (value, number))
    database.close()


def test_the_rest_is_exported_and_the_damage_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    filled(tmp_path / "j")
    flip(tmp_path / "j", "captures", "blob", 5)
    export(tmp_path / "j", tmp_path / "c")
    assert [shot.cycle for shot in read(tmp_path / "c").shots] == [1, 2, 3, 4, *range(6, 13)]
    assert (
        "cycle 5: the stored capture is damaged: its checksum is wrong; it is left out"
        in capsys.readouterr().err
    )


def test_a_damaged_page_costs_its_captures_only(tmp_path: Path) -> None:
    path = tmp_path / "j"
    filled(path, 40)
    pages = path.stat().st_size // PAGE
    cost = []
    for page in range(2, pages):
        copy = tmp_path / "copy"
        shutil.copy(path, copy)
        with copy.open("r+b") as file:
            file.seek(page * PAGE)
            file.write(b"\xff" * PAGE)
        told: list[str] = []
        try:
            with Journal(copy, "c", read_only=True) as journal:
                found = [capture.cycle for capture in journal.captures(damaged=told.append)]
        except JournalDamagedError:
            continue  # not even the tables can be found: that is for whoever opens it
        assert len(found) + len(told) == 40
        assert found == sorted(set(found))
        cost.append(len(told))
    assert sorted(cost)[len(cost) // 2] <= 10
    assert len(cost) > pages // 2


@pytest.mark.parametrize("column", ["wear_level", "mu_s", "mu_s_quality", "time_ns", "estimator"])
def test_one_bit_in_a_cycle_is_not_believed(tmp_path: Path, column: str) -> None:
    filled(tmp_path / "j")
    flip(tmp_path / "j", "cycles", column, 7)
    with Journal(tmp_path / "j", "c") as journal:
        times = [value.time_ns for value in journal.values("Wear/Level", HistoryQuery()).entries]
    assert times == [make_capture(cycle).time_ns for cycle in range(1, 13) if cycle != 7]


@pytest.mark.parametrize("column", ["cycle", "session", "wear_level"])
def test_of_a_damaged_last_row_the_capture_tells_which_cycle_it_was(tmp_path: Path, column: str) -> None:
    filled(tmp_path / "j")
    flip(tmp_path / "j", "cycles", column, 12)
    with Journal(tmp_path / "j", "c") as journal:
        assert journal.last_cycle_id() == CycleId(1, 12)
        capture = make_capture(12)
        with pytest.raises(JournalError, match="cycle 12 is stored already"):
            journal.append(capture, make_snapshot(capture), b"state")


def test_a_damaged_last_row_whose_capture_is_damaged_too_does_not_count(tmp_path: Path) -> None:
    filled(tmp_path / "j")
    flip(tmp_path / "j", "cycles", "cycle", 12)
    flip(tmp_path / "j", "captures", "blob", 12)
    with Journal(tmp_path / "j", "c") as journal:
        assert journal.last_cycle_id() == CycleId(1, 11)


@pytest.mark.parametrize("damaged", ["row and capture", "table", "backup"])
async def test_a_cycle_counts_once_whatever_of_it_is_damaged(
    tmp_path: Path, design: core.CellDesign, damaged: str
) -> None:
    path = tmp_path / "j"
    with Journal(path, "c") as journal:
        worker = CellWorker(design, journal, Retention())
        for cycle in range(1, 8):
            await process(worker, make_capture(cycle))
            if cycle == 5:
                journal.back_up_state()
        await worker.close()
    if damaged == "row and capture":
        flip(path, "cycles", "cycle", 7)
        flip(path, "captures", "blob", 7)
    elif damaged == "table":  # put aside, so that the journal has a state and no cycle at all
        database = sqlite3.connect(path)
        [page] = database.execute("SELECT rootpage FROM sqlite_schema WHERE name = 'meta'").fetchone()
        database.close()
        with path.open("r+b") as file:
            file.seek((page - 1) * PAGE)
            file.write(b"\xff" * PAGE)
    else:
        flip(path, "state", "blob", 1)
    journal, _ = open_journal(path, "c")
    worker = CellWorker(design, journal, Retention())
    assert worker.last == CycleId(1, 7)  # what the module's ring is read behind
    assert bool(aside_of(path)) == (damaged == "table")
    await process(worker, make_capture(8))
    assert worker.last == CycleId(1, 8)
    await worker.close()


def test_one_bit_in_an_action_of_a_person_is_not_believed(tmp_path: Path) -> None:
    filled(tmp_path / "j")
    flip(tmp_path / "j", "audit", "user", 1)
    with Journal(tmp_path / "j", "c") as journal:
        assert journal.audit() == ()


async def test_one_bit_in_the_state_is_not_believed_and_an_earlier_state_is_used(
    tmp_path: Path, design: core.CellDesign, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("impactcell.service.journal_writer.CHECKPOINT_EVERY", 1)
    monkeypatch.setattr("impactcell.service.journal_writer.PRUNE_EVERY", 5)
    path = tmp_path / "j"
    worker = CellWorker(design, Journal(path, "c"), Retention())
    for cycle in range(1, 8):
        await process(worker, make_capture(cycle))
    await worker.close()
    flip(path, "state", "blob", 1)
    journal, told = open_journal(path, "c")
    assert told == ""
    worker = CellWorker(design, journal, Retention())
    [event] = worker.take_journal_events()
    assert "the table state is damaged" in event
    assert "the state of an earlier cycle is used instead" in event
    assert worker.snapshot is not None
    assert 1 <= worker.snapshot.cycle < 7
    assert worker.durable == CycleId(1, 7)
    assert await process(worker, make_capture(8)) == CycleId(1, 8)
    await worker.close()


@pytest.mark.slow
async def test_a_cell_runs_on_whatever_page_is_damaged(tmp_path: Path, design: core.CellDesign) -> None:
    path = tmp_path / "whole" / "j"
    path.parent.mkdir()
    worker = CellWorker(design, Journal(path, "c"), Retention())
    for cycle in range(1, 13):
        await process(worker, make_capture(cycle))
    await worker.close()
    begun_anew = 0
    for page in range(path.stat().st_size // PAGE):
        damaged = tmp_path / str(page) / "j"
        damaged.parent.mkdir()
        shutil.copy(path, damaged)
        with damaged.open("r+b") as file:
            file.seek(page * PAGE + 100 * (page == 0))  # the file's header says whose it is
            file.write(b"\xff" * (PAGE - 100))
        journal, told = open_journal(damaged, "c")
        worker = CellWorker(design, journal, Retention())
        for cycle in (13, 14, 15, 16):
            await process(worker, make_capture(cycle))
        events = [*([told] if told else []), *worker.take_journal_events()]
        assert (worker.durable, worker.journal_fault) == (CycleId(1, 16), ""), page
        await worker.close()
        aside = aside_of(damaged)
        assert bool(aside) <= bool(events)
        begun_anew += bool(aside)
        assert {13, 14, 15, 16} <= {cycle for file in (damaged, *aside) for cycle in readable(file)}, page
    assert begun_anew > 2


def readable(path: Path) -> list[int]:
    """Cycles whose captures can be read."""
    try:
        with Journal(path, None, read_only=True) as journal:
            return [capture.cycle for capture in journal.captures(damaged=lambda _: None)]
    except JournalError:
        return []


def aside_of(path: Path) -> list[Path]:
    return [file for file in path.parent.glob(f"{path.name}.damaged-*") if file.suffix.endswith("Z")]


async def test_a_file_that_is_damaged_under_a_running_cell_is_put_aside_and_told(
    tmp_path: Path, design: core.CellDesign, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "j"
    journal = Journal(path, "c")
    worker = CellWorker(design, journal, Retention())
    assert await process(worker, make_capture(1)) == CycleId(1, 1)

    def damaged(*_: object) -> None:
        raise JournalDamagedError("a page is damaged")

    with monkeypatch.context() as broken:
        broken.setattr(journal, "append", damaged)
        assert await process(worker, make_capture(2)) == CycleId(1, 1)
        assert worker.journal_fault == "a page is damaged"
    assert await process(worker, make_capture(3)) == CycleId(1, 3)
    [first, second] = worker.take_journal_events()
    [aside] = aside_of(path)
    assert first == "a page is damaged"
    assert f"put aside as {aside.name}" in second
    await worker.close()
    assert (cycles(aside), cycles(path)) == ([1], [2, 3])
