"""The service goes on from what an earlier version has learned, and says what it cannot go on from."""

import asyncio
import sqlite3
from pathlib import Path
from typing import Any

import pytest

from impactcell.errors import JournalError
from impactcell.journal.store import Journal
from impactcell.journal.stored_forms import STATE
from impactcell.records import Alarm
from impactcell.scada import Server
from impactcell.serialization.message_pack import pack_tree, unpack_tree
from tests.data.contents import described, stored, without_later_conditions
from tests.data.journals import FORMATS, copy_journal, what_was_read
from tests.data.make_journal import CELL, CELL_FILE
from tests.integration.processes import write_cell
from tests.integration.watched import serving
from tests.patience import COMPILING_S

pytestmark = pytest.mark.slow


@pytest.fixture
def older(tmp_path: Path) -> Path:
    """Journal of `CELL`, as format 3 left it."""
    return copy_journal(3, tmp_path / f"{CELL}.sqlite")


def content(file: Path) -> bytes:
    return file.read_bytes()


def learned(read: dict[str, Any]) -> dict[str, Any]:
    """What a journal holds, but for the link, of which the service says something itself."""
    conditions = read["alarms"]["conditions"]
    kept = {name: alarm for name, alarm in conditions.items() if name != "ModuleConnection"}
    told = [a for a in read["transitions of alarms"] if a["condition"] != "ModuleConnection"]
    return {**read, "alarms": {**read["alarms"], "conditions": kept}, "transitions of alarms": told}


@pytest.mark.parametrize("number", FORMATS)
async def test_the_service_goes_on_from_an_older_journal(tmp_path: Path, number: int) -> None:
    older = copy_journal(number, tmp_path / f"{CELL}.sqlite")
    async with serving(write_cell(tmp_path, 1, CELL, **CELL_FILE)) as watched:
        running = watched.service.running[CELL]
        await watched.alarm(CELL, "ModuleConnection", active=True)
        shown = {alarm.name: alarm for alarm in running.worker.alarms}
        assert shown["WearLimit"].active
        assert not shown["JournalFault"].active
        assert running.worker.journal_fault == ""
        assert running.worker.snapshot is not None
    with Journal(older, CELL, read_only=True) as journal:
        read = described(stored(journal), journal)
        assert not STATE.is_older(journal.state() or b"")
    expected = what_was_read(number)
    assert learned(without_later_conditions(read, expected)) == learned(expected)


@pytest.fixture
def later(older: Path) -> Path:
    """Journal of `CELL` with a state of a later version."""
    database = sqlite3.connect(older)
    with database:
        (blob,) = database.execute("SELECT blob FROM state").fetchone()
        state = pack_tree({"format": STATE.format + 1, "content": unpack_tree(blob)})
        database.execute("UPDATE state SET blob = ?", (state,))
    database.close()
    return older


async def test_a_later_state_is_left_alone_with_an_alarm_and_the_others_run(
    tmp_path: Path, later: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = content(later)
    shown: list[tuple[str, Alarm]] = []
    show = Server.alarm

    def seen(server: Server, cell: str, alarm: Alarm) -> None:
        shown.append((cell, alarm))
        show(server, cell, alarm)

    monkeypatch.setattr(Server, "alarm", seen)
    odd, well = write_cell(tmp_path, 1, CELL, **CELL_FILE), write_cell(tmp_path, 2, "well")
    async with serving(odd, well) as watched:
        await watched.alarm("well", "ModuleConnection", active=True)
        async with asyncio.timeout(COMPILING_S):
            while not any(cell == CELL for cell, _ in shown):
                await asyncio.sleep(0.02)
        assert CELL not in watched.service.running
    ((_, alarm),) = [entry for entry in shown if entry[0] == CELL]
    assert (alarm.name, alarm.active, alarm.acknowledged) == ("JournalFault", True, False)
    known = f"the state is of format {STATE.format + 1}, this version knows up to {STATE.format}"
    for words in (str(later), f"cell '{CELL}' is left as it is", known, "name another file"):
        assert words in alarm.message
        assert words in caplog.text
    assert content(later) == before
    with pytest.raises(JournalError, match=known):
        async with serving(odd):
            pass
    assert content(later) == before
