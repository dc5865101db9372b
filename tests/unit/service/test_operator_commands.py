"""Every command and every action on an alarm is in the journal's audit trail, with what came of it."""

import json
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path

import pytest

from impactcell.alarms import EventKind, RuleResult
from impactcell.journal.history import HistoryQuery
from impactcell.journal.store import Journal
from impactcell.scada import Actor, RefusedError, Role
from impactcell.service.cell_task import CellTask
from impactcell.service.operator_commands import OperatorCommands
from impactcell.settings import read_cell
from impactcell.settings.sections import JournalSection
from tests.integration.processes import CONFIG

ANNA = Actor("anna", Role.ENGINEER, "10.0.0.7")


@pytest.fixture
async def task(tmp_path: Path) -> AsyncIterator[CellTask]:
    """A cell with a journal and without positioning; its module is never asked."""
    cell = read_cell(CONFIG / "cells" / "prototype.yaml")
    journal = JournalSection(file=tmp_path / "j")
    settings = cell.settings.model_copy(update={"journal": journal, "positioning": None})
    made = CellTask(replace(cell, settings=settings))
    yield made
    await made.close()


def trail(tmp_path: Path) -> list[tuple[str, str, dict[str, object], str]]:
    with Journal(tmp_path / "j", None, read_only=True) as journal:
        return [(e.user, e.action, json.loads(e.arguments), e.result) for e in journal.audit()]


async def test_commands(task: CellTask, tmp_path: Path) -> None:
    commands, cell = OperatorCommands({task.cell.name: task}), task.cell.name
    await commands.start_batch(cell, "B-7", expected=False, actor=ANNA)
    await commands.reset_wear(cell, "", ANNA)
    with pytest.raises(RefusedError):
        await commands.set_target(cell, 0.0, ANNA)
    with pytest.raises(RefusedError):
        await commands.abort_positioning(cell, ANNA)
    who = "anna (engineer) from 10.0.0.7"
    refused = f"{cell}: this cell has no positioning; add it to {task.cell.path}"
    assert trail(tmp_path) == [
        (who, "StartBatch", {"BatchId": "B-7", "Expected": False}, "Good"),
        (who, "ResetWear", {"Comment": ""}, "Good"),
        (who, "SetTarget", {"Target": 0.0}, refused),
        (who, "AbortPositioning", {}, refused),
    ]


async def test_what_a_reset_of_wear_ends_is_in_the_journal(task: CellTask, tmp_path: Path) -> None:
    commands, cell = OperatorCommands({task.cell.name: task}), task.cell.name
    for _ in range(6):  # its delay is of five cycles
        await task.worker.apply_rule_result(RuleResult("WearLimit", holds=True), 1)
    await commands.reset_wear(cell, "new plate", ANNA)
    with Journal(tmp_path / "j", None, read_only=True) as journal:
        stored = [(alarm.name, alarm.active) for alarm in journal.alarms(HistoryQuery()).entries]
    assert stored == [("WearLimit", True), ("WearLimit", False)]
    assert trail(tmp_path)[-1][1:] == ("ResetWear", {"Comment": "new plate"}, "Good")


async def test_actions_on_alarms(task: CellTask, tmp_path: Path) -> None:
    commands, cell = OperatorCommands({task.cell.name: task}), task.cell.name

    async def act(event: EventKind, comment: str = "", shelve_s: float = 0.0) -> None:
        await commands.act_on_condition(
            cell, "ModuleConnection", event, ANNA, comment=comment, shelve_s=shelve_s
        )

    with pytest.raises(RefusedError):
        await act(EventKind.ACKNOWLEDGE, "nothing to acknowledge")
    await task.worker.apply_rule_result(RuleResult("ModuleConnection", holds=True), 1)
    await act(EventKind.ACKNOWLEDGE, "seen")
    await act(EventKind.SHELVE_TIMED, shelve_s=60.0)
    of = {"Condition": "ModuleConnection"}
    (first, *others) = trail(tmp_path)
    assert first[1:3] == ("acknowledge", {**of, "Comment": "nothing to acknowledge"})
    assert first[3].startswith("Bad")
    assert [entry[1:] for entry in others] == [
        ("acknowledge", {**of, "Comment": "seen"}, "Good"),
        ("shelve for a time", {**of, "Seconds": 60.0}, "Good"),
    ]
