"""The journal's file is removed or replaced while the service runs: what is lost is never called durable."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from impactcell import cell as core
from impactcell.journal.retention import Retention
from impactcell.journal.store import Journal
from impactcell.records import CycleId
from impactcell.service.worker import CellWorker
from tests.snapshots import make_capture
from tests.unit.service.test_worker import cycles, design, process

__all__ = ["design"]


def removed(path: Path) -> None:
    path.unlink()


def moved_away(path: Path) -> None:
    path.rename(path.with_name("elsewhere"))


def replaced(path: Path) -> None:
    """By a copy of itself, as an editor or a restored backup does."""
    copy = path.with_name("copy")
    shutil.copy(path, copy)
    copy.replace(path)


def without_log(path: Path) -> None:
    path.with_name(f"{path.name}-wal").unlink()


def all_of_it(path: Path) -> None:
    for part in path.parent.glob(f"{path.name}*"):
        part.unlink()


@pytest.mark.parametrize("happens", [removed, moved_away, replaced, without_log, all_of_it])
async def test_it_is_noticed_within_a_cycle_and_nothing_lost_is_called_durable(
    tmp_path: Path, design: core.CellDesign, happens: Callable[[Path], None]
) -> None:
    path = tmp_path / "j"
    worker = CellWorker(design, Journal(path, "c"), Retention())
    for cycle in (1, 2, 3):
        assert await process(worker, make_capture(cycle)) == CycleId(1, cycle)
    happens(path)
    assert await process(worker, make_capture(4)) == CycleId(1, 3)
    assert str(path) in worker.journal_fault
    assert "while the journal was in use" in worker.journal_fault
    assert await process(worker, make_capture(5)) == CycleId(1, 5)
    assert worker.journal_fault == ""
    await worker.close()
    assert cycles(path)[-2:] == [4, 5]
    with Journal(path, "c") as journal:
        assert journal.model
        assert journal.state() is not None


async def test_a_journal_that_cannot_be_begun_anew_is_tried_again(
    tmp_path: Path, design: core.CellDesign
) -> None:
    path = tmp_path / "disk" / "j"
    path.parent.mkdir()
    worker = CellWorker(design, Journal(path, "c"), Retention())
    assert await process(worker, make_capture(1)) == CycleId(1, 1)
    path.parent.rename(tmp_path / "gone")
    for cycle in (2, 3):
        assert await process(worker, make_capture(cycle)) == CycleId(1, 1)
        assert worker.journal_fault
    path.parent.mkdir()
    await worker.retry()
    assert (worker.journal_fault, worker.durable) == ("", CycleId(1, 3))
    await worker.close()
    assert cycles(path) == [2, 3]
