"""The power is cut at 200 moments, on a disk that keeps no more than it must: nothing acknowledged is lost.

A journal that is cut off while it is made is made anew, and is never taken for a foreign file.
"""

import random
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest

from impactcell.errors import JournalError
from impactcell.journal.audit_entries import AuditEntry
from impactcell.journal.retention import Retention
from impactcell.journal.store import Journal
from impactcell.records import Alarm, CycleId
from tests.snapshots import make_capture, make_snapshot
from tests.unit.journal.lossy_disk import Recording, Step, disk_after_cut, recorded

pytestmark = pytest.mark.slow

CUTS = 200
LIVES, CYCLES = 3, 12
"""Times that the journal is opened, and cycles in each."""
NAME = "cell.sqlite"


def live(directory: Path, recording: Recording, prepare: Callable[[Journal], None]) -> None:
    """Fill a journal in several lives of the service, as a cell does, and mark what was acknowledged."""
    for life in range(LIVES):
        with Journal(directory / NAME, "press-1") as journal:
            prepare(journal)
            journal.store_model(f"model {life}")
            for cycle in range(life * CYCLES + 1, (life + 1) * CYCLES + 1):
                capture = make_capture(cycle, samples=100)
                journal.append(
                    capture, make_snapshot(capture), b"state %d" % cycle, [Alarm("WearLimit", time_ns=cycle)]
                )
                recording.mark("acknowledged", cycle)
                if cycle % 5 == 0:
                    entry = AuditEntry(capture.time_ns, "anna", str(cycle), "", "Good")
                    journal.record(b"state %d" % cycle, (), entry)
                    recording.mark("audited", cycle)
                    journal.checkpoint()
                if cycle % 9 == 0:
                    journal.back_up_state()
                    journal.prune(Retention(max_size_bytes=10**9), make_capture(cycle).time_ns)


def lost(steps: list[Step], directory: Path, draw: random.Random) -> str:
    """Cut the power after `steps` and open what is there; says what is wrong with it, if anything is."""
    directory.mkdir()
    disk_after_cut(steps, directory, draw)
    acknowledged = max((step.at for step in steps if step.what == "acknowledged"), default=0)
    audited = [step.at for step in steps if step.what == "audited"]
    with Journal(directory / NAME, "press-1") as journal:
        last = journal.last_cycle_id() or CycleId(1, 0)
        stored = [capture.cycle for capture in journal.captures()]
        if stored != list(range(1, last.cycle + 1)) or last.cycle < acknowledged:
            return f"cycles {stored} of {acknowledged}"
        if journal.state() != (b"state %d" % last.cycle if last.cycle else None):
            return f"state {journal.state()!r} at cycle {last.cycle}"
        if [int(entry.action) for entry in journal.audit()][: len(audited)] != audited:
            return f"audit {journal.audit()} of {audited}"
        capture = make_capture(last.cycle + 1, samples=100)
        journal.append(capture, make_snapshot(capture), b"after")
        if journal._db.execute("PRAGMA auto_vacuum").fetchone() != (2,):
            return "room that is given back is not used again"
        if journal._db.execute("PRAGMA integrity_check").fetchone() != ("ok",):
            return "the file is not in order"
    return ""


def cuts(tmp_path: Path, number: int, prepare: Callable[[Journal], None]) -> list[str]:
    """Cut the power so often: at each moment until the first cycle, then at random; what was lost."""
    (tmp_path / "recorded").mkdir()
    with recorded() as recording:
        live(tmp_path / "recorded", recording, prepare)
    if not any(step.what == "sync" for step in recording.steps):
        pytest.skip("the SQLite library of this Python cannot be given hooks")
    whole = (tmp_path / "recorded" / NAME).read_bytes()
    draw = random.Random(20261122)
    (tmp_path / "whole").mkdir()
    disk_after_cut([*recording.steps, Step("sync", NAME), Step("sync directory")], tmp_path / "whole", draw)
    assert (tmp_path / "whole" / NAME).read_bytes() == whole, "the recording is not all that was done"
    first = next(i for i, step in enumerate(recording.steps) if step.what == "acknowledged")
    moments = [*range(first), *draw.sample(range(first, len(recording.steps) + 1), number - first)]
    found = []
    for moment in moments:
        try:
            found.append(lost(recording.steps[:moment], tmp_path / str(moment), draw))
        except (JournalError, sqlite3.Error, TypeError) as error:  # of a row that is all nothing
            found.append(f"{type(error).__name__}: {error}")
    return [each for each in found if each]


def test_nothing_acknowledged_is_lost(tmp_path: Path) -> None:
    assert cuts(tmp_path, CUTS, lambda _: None) == []


@pytest.mark.parametrize("synchronous", ["OFF", "NORMAL"])
def test_without_full_synchronisation_the_same_cuts_lose_cycles(tmp_path: Path, synchronous: str) -> None:
    """Else the test above would prove nothing."""
    found = cuts(tmp_path, 90, lambda journal: journal._db.execute(f"PRAGMA synchronous = {synchronous}"))
    assert any(each.startswith("cycles") for each in found)
