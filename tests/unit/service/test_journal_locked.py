"""Another program holds the journal: the cell goes on, says what is wrong, and stores all once it may."""

import contextlib
import sqlite3
from pathlib import Path

import pytest

from impactcell import cell as core
from impactcell.journal.database import WRITE_PATIENCE_S
from impactcell.journal.retention import Retention
from impactcell.journal.store import Journal
from impactcell.records import CycleId, PositioningState
from impactcell.service.factory import cell_design
from impactcell.service.worker import CellWorker
from impactcell.settings import read_cell
from tests.integration.processes import CONFIG
from tests.snapshots import make_capture


@pytest.fixture(scope="module")
def design() -> core.CellDesign:
    return cell_design(read_cell(CONFIG / "cells" / "prototype.yaml"))


async def test_what_comes_while_another_program_writes_is_stored_afterwards(
    tmp_path: Path, design: core.CellDesign
) -> None:
    path = tmp_path / "j"
    worker = CellWorker(design, Journal(path, "c"), Retention())
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        for cycle in (1, 2, 3):
            shown = await worker.process(make_capture(cycle), PositioningState(), None)
            assert (shown.snapshot.cycle, worker.durable) == (cycle, None)
        assert worker.journal_fault == (
            f"{path}: another program has it open for writing (database is locked); close it there"
        )
        other.execute("ROLLBACK")
    await worker.retry()
    assert (worker.journal_fault, worker.durable, worker.lost) == ("", CycleId(1, 3), 0)
    await worker.close()


def test_no_cycle_stands_still_for_another_program(tmp_path: Path) -> None:
    """SQLite's own patience, 5 s, held the cell's thread at each cycle and at each retry."""
    path = tmp_path / "j"
    for _ in ("made", "opened again"):
        with Journal(path, "c") as journal:
            assert journal._db.execute("PRAGMA busy_timeout").fetchone() == (1e3 * WRITE_PATIENCE_S,)
            assert WRITE_PATIENCE_S <= 0.1
