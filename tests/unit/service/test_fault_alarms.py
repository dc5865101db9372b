"""Alarms beside the cycles tell what is wrong now: another fault too, and none that only comes and goes."""

import asyncio
import contextlib
import logging
import threading
import time
from collections.abc import AsyncIterator, Awaitable
from dataclasses import replace
from pathlib import Path

import pytest

from impactcell.alarms import AlarmEvent, EventKind
from impactcell.alarms.rules import journal_fault, module_connection, positioning_fault
from impactcell.journal.audit_entries import AuditEntry
from impactcell.journal.history import HistoryQuery
from impactcell.journal.store import Journal
from impactcell.numerics import compilation
from impactcell.numerics.compilation import announce_compilation
from impactcell.positioning.task_state_machine import TaskPhase, TaskState
from impactcell.records import Alarm, Evidence, ModuleStatus
from impactcell.service.cell_task import CellTask
from impactcell.service.fault_alarms import STANDS_S, FaultAlarms, SettledReason
from impactcell.settings import read_cell
from impactcell.settings.sections import JournalSection
from impactcell.web.interface import Freshness
from impactcell.web.live_feed import LiveFeed
from tests.integration.processes import CONFIG
from tests.patience import PATIENCE_S

SILENT = "press-1: 10.0.0.9:502 device 1: no connection within 500 ms (timeout_ms)"
NO_ROUTE = "press-1: 10.0.0.9:502 device 1: no connection: No route to host"
STRANGER = "press-1: 10.0.0.9:502 device 1: register magic (0) shows 7, map prototype expects 18753"
ANOTHER = STRANGER.replace("shows 7", "shows 8")


def told(reasons: list[tuple[float, str]]) -> list[str]:
    settled = SettledReason()
    return [settled.update(ModuleStatus(reason=reason), time_s).reason for time_s, reason in reasons]


def test_another_reason_is_told_once_it_has_stood() -> None:
    late = STANDS_S + 1.0
    assert told([(0.0, SILENT), (1.0, STRANGER), (late - 0.1, STRANGER), (late, STRANGER)]) == [
        *(SILENT, SILENT, SILENT, STRANGER),
    ]
    assert told([(0.0, SILENT), (1.0, STRANGER), (2.0, ANOTHER), (late, ANOTHER)])[-1] == STRANGER
    assert told([(0.0, SILENT), (1.0, ""), (1.1, STRANGER)]) == [SILENT, "", STRANGER]


def test_reasons_that_take_turns_are_told_once() -> None:
    """A module that is switched off has no route to it at one attempt, and is silent at the next."""
    turns = [(0.5 * attempt, (SILENT, NO_ROUTE)[attempt % 2]) for attempt in range(1000)]
    assert set(told(turns)) == {SILENT}


def test_one_that_differs_in_its_numbers_alone_is_the_same() -> None:
    counted = [(float(n), f"press-1: an answer to transaction {n}, which is not open") for n in range(1000)]
    assert len(set(told(counted))) == 1


@pytest.fixture(params=[True])
async def task(tmp_path: Path, request: pytest.FixtureRequest) -> AsyncIterator[CellTask]:
    """A cell that positions, with a journal or without; its module is never asked."""
    cell = read_cell(CONFIG / "cells" / "positioning.yaml")
    journal = JournalSection(file=tmp_path / "j") if request.param else None
    settings = cell.settings.model_copy(update={"journal": journal})
    made = CellTask(replace(cell, settings=settings))
    yield made
    await made.close()


def alarm(task: CellTask, name: str) -> Alarm:
    return next(alarm for alarm in task.worker.alarms if alarm.name == name)


async def acknowledge(task: CellTask, name: str) -> None:
    now_ns = time.time_ns()
    event = AlarmEvent(EventKind.ACKNOWLEDGE, time_ns=now_ns, user="anna")
    done = await task.worker.apply_event(name, event, AuditEntry(now_ns, "anna", "Acknowledge", "{}", "Good"))
    assert done.refusal is None


@contextlib.asynccontextmanager
async def beside(work: Awaitable[None]) -> AsyncIterator[None]:
    running = asyncio.ensure_future(work)
    try:
        yield
    finally:
        running.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await running


async def says(task: CellTask, name: str, words: str) -> Alarm:
    async with asyncio.timeout(PATIENCE_S):
        while words not in alarm(task, name).message:
            await asyncio.sleep(0.01)
    return alarm(task, name)


async def transitions(task: CellTask, tmp_path: Path, name: str) -> list[Alarm]:
    await task.worker.run(lambda: None)
    with Journal(tmp_path / "j", None, read_only=True) as journal:
        return [a for a in journal.alarms(HistoryQuery()).entries if a.name == name]


async def test_the_next_target_that_is_refused_calls_again(task: CellTask, tmp_path: Path) -> None:
    """The alarm stood acknowledged, with what was wrong with the target before."""
    name, positioning = positioning_fault.NAME, task._positioning
    assert positioning is not None

    def refuse(reason: str) -> None:
        positioning._set_sequence(TaskState(TaskPhase.FAULTED, reason=reason, evidence=Evidence()))

    async with beside(task._publish_positioning()):
        refuse("press-1: target 500.000 mm is beyond the travel of 0 to 40 mm")
        await says(task, name, "500.000 mm is beyond")
        await acknowledge(task, name)
        refuse("press-1: the mass of the part is not known")
        again = await says(task, name, "mass of the part")
    assert (again.active, again.acknowledged) == (True, False)
    assert [a.acknowledged for a in await transitions(task, tmp_path, name)] == [False, True, False]


async def test_a_lost_link_tells_why_it_is_lost_now(
    task: CellTask, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was to check the cable, while a module of another kind answered."""
    monkeypatch.setattr("impactcell.service.fault_alarms.STANDS_S", 0.0)
    monkeypatch.setattr("impactcell.service.cell_task.TICK_S", 0.01)
    name = module_connection.NAME
    async with beside(task._tell_link()), beside(task._tick()):
        task._module._account.disconnect(SILENT)
        await says(task, name, "no connection within 500 ms (timeout_ms)")
        await acknowledge(task, name)
        assert "Check its power, its network cable" in alarm(task, name).message
        task._module._account.disconnect(STRANGER, answered=True)
        now = await says(task, name, "map prototype expects 18753")
        assert (now.active, now.acknowledged) == (True, True)
        assert "Something answers" in now.message
        assert "Check address, port and register map of the cell." in now.message
        assert "Adresse, Port und Registerkarte der Zelle prüfen." in now.message_de
        assert "cable" not in now.message
        assert "die Karte prototype erwartet 18753" in now.message_de
        for attempt in range(100):  # which of them stands cannot be seen, and nothing is told of numbers
            reason = STRANGER.replace("shows 7", f"shows {attempt}")
            task._module._account.disconnect(reason, answered=True)
            await asyncio.sleep(0)
        task._module._account.connect("the module")
        async with asyncio.timeout(PATIENCE_S):
            while alarm(task, name).active:
                await asyncio.sleep(0.01)
    assert len(await transitions(task, tmp_path, name)) == 4


async def test_a_start_of_the_service_is_no_fault_of_the_link(
    task: CellTask, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each start raised an alarm that a person had to acknowledge; the first attempt that fails is one."""
    monkeypatch.setattr("impactcell.service.cell_task.TICK_S", 0.0)
    name, ticks = module_connection.NAME, 0
    expire = task.worker.expire_shelving

    async def count(time_ns: int) -> None:
        nonlocal ticks
        ticks += 1
        await expire(time_ns)

    monkeypatch.setattr(task.worker, "expire_shelving", count)
    async with beside(task._tell_link()), beside(task._tick()):
        async with asyncio.timeout(PATIENCE_S):
            while ticks < 5:
                await asyncio.sleep(0)
        assert not alarm(task, name).active
        task._module._account.disconnect(SILENT)
        assert (await says(task, name, "no connection within 500 ms (timeout_ms)")).active
    assert [a.active for a in await transitions(task, tmp_path, name)] == [True]


def started(task: CellTask, monkeypatch: pytest.MonkeyPatch) -> LiveFeed:
    """Publish the start of a task whose process has lacked no machine code; give what the page is told."""
    task._publisher.feed = feed = LiveFeed([task.cell.name])
    monkeypatch.setattr(compilation, "_lacked", threading.Event())
    task._publish_restored()
    return feed


@pytest.mark.parametrize("task", [False], indirect=True)
async def test_a_module_that_was_not_asked_yet_is_not_told_to_be_lost(
    task: CellTask, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page said so in red for the minutes that a new machine compiles for."""
    feed = started(task, monkeypatch)
    card = feed.views[task.cell.name].card()
    assert card["freshness"] == "starting"
    assert card["link_reason"]["en"] == task.health.reason
    assert task.health.reason == "not connected yet (starting)"
    assert card["link_reason"]["de"] == "noch nicht verbunden (startet)"
    task._module._account.disconnect(SILENT)
    assert feed.views[task.cell.name].card()["freshness"] == "lost"
    assert task.health.reason == SILENT
    task._publisher.publish_start(task.status)
    assert feed.views[task.cell.name].card()["freshness"] == "lost"
    task._publish_restored()  # begun anew after a fault
    assert feed.views[task.cell.name].card()["freshness"] == "lost"


@pytest.mark.parametrize("task", [False], indirect=True)
async def test_a_start_says_that_it_compiles_only_where_it_does(
    task: CellTask, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each start said so, also where the machine code was on the disk."""
    feed = started(task, monkeypatch)
    assert feed.views[task.cell.name].card()["freshness"] == "starting"
    monkeypatch.setattr("impactcell.service.cell_task.TICK_S", 0.0)
    announce_compilation()
    async with beside(task._tick()), asyncio.timeout(PATIENCE_S):
        while feed.views[task.cell.name].card()["freshness"] != "compiling":
            await asyncio.sleep(0)


class Shown:
    """What OPC UA clients are told of all values of a cell."""

    def __init__(self) -> None:
        self.marks: list[str] = []

    def mark_bad(self, *_: object) -> None:
        self.marks.append("bad")

    def mark_stale(self, *_: object) -> None:
        self.marks.append("stale")

    def module(self, *_: object) -> None: ...


@pytest.mark.parametrize("task", [False], indirect=True)
async def test_values_are_of_before_while_the_link_is_there_again_and_no_cycle_has_come(
    task: CellTask,
) -> None:
    """They stayed lost until the next cycle where they had been stale before, and for a while else."""
    shown, feed = Shown(), LiveFeed([task.cell.name])
    task._publisher.server, task._publisher.feed = shown, feed  # type: ignore[assignment]
    seen = []
    account = task._module._account
    for _ in range(3):
        for change in (lambda: account.connect("the module"), lambda: account.disconnect(SILENT)):
            change()
            seen.append(feed.views[task.cell.name].freshness)
    assert seen == [Freshness.STALE, Freshness.LOST] * 3
    assert shown.marks == ["stale", "bad"] * 3


@pytest.mark.parametrize("task", [False], indirect=True)
async def test_a_journal_tells_what_has_happened_to_it_since(
    task: CellTask, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    faults, name = FaultAlarms(task.worker, task.log), journal_fault.NAME
    writer = task.worker._journal_writer
    for fault, events, words in (
        ("/j: the disk is full", [], "the disk is full"),
        ("/j: the disk is full", ["/j: is gone"], "the disk is full"),
        ("/j: not stored, 3 of 7", [], "3 of 7"),
        ("/j: not stored, 4 of 7", [], "3 of 7"),
    ):
        writer.fault, writer._events = fault, events
        await faults.check_journal()
        assert words in alarm(task, name).message
    assert alarm(task, name).active
    writer.fault = ""
    await faults.check_journal()
    assert not alarm(task, name).active
    assert len([r for r in caplog.records if "disk is full" in r.getMessage()]) == 2
    await faults.check_journal()
    (over,) = [r for r in caplog.records if r.getMessage().endswith("the journal is written again")]
    assert (over.levelno, over) == (logging.INFO, caplog.records[-1])
