"""What people do and what cycles bring is shown in the order in which it happened, however they meet."""

import asyncio
import itertools
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from impactcell import cell as core
from impactcell.alarms import AlarmEvent, EventKind, RuleResult
from impactcell.cell import StepResult
from impactcell.fieldbus.acquisition import ReceivedCycle
from impactcell.records import Alarm, Capture, CycleId, PositioningState, Snapshot
from impactcell.scada import Actor, RefusedError, Role
from impactcell.service.cell_task import CellTask
from impactcell.service.operator_commands import OperatorCommands
from impactcell.settings import CellConfig, read_cell
from impactcell.web.interface import CellNews
from tests.integration.processes import CONFIG
from tests.patience import PATIENCE_S
from tests.snapshots import make_capture, make_snapshot

pytestmark = pytest.mark.slow

ALARM = "ModuleConnection"
ANNA = Actor("anna", Role.OPERATOR, "10.0.0.7")
STEPS = 6
"""Long enough for a cycle and an action to be through, one after the other."""


def received(capture: Capture) -> ReceivedCycle:
    """A cycle as acquisition gives it, with nothing wrong."""
    identity = CycleId(capture.session, capture.cycle)
    return ReceivedCycle(capture, identity, missed=0, restarted=False, faults=())


class Thread:
    """A cell's thread that does the next piece of work when it is told to."""

    def __init__(self) -> None:
        self.waiting: deque[tuple[Future[object], Callable[[], object]]] = deque()

    def submit(self, work: Callable[..., object], *arguments: object) -> Future[object]:
        future: Future[object] = Future()
        self.waiting.append((future, lambda: work(*arguments)))
        return future

    def step(self) -> None:
        if self.waiting:
            future, work = self.waiting.popleft()
            try:
                future.set_result(work())
            except RefusedError as error:
                future.set_exception(error)

    def shutdown(self, *, wait: bool) -> None:
        assert not self.waiting


class World:
    """Everything that a cell is shown to: an OPC UA server and a page."""

    def __init__(self) -> None:
        self.alarms: list[Alarm] = []
        self.on_page: list[Alarm] = []
        self.taps: list[int] = []

    def alarm(self, _cell: str, alarm: Alarm) -> None:
        if alarm.name == ALARM:
            self.alarms.append(alarm)

    def publish(self, _cell: str, snapshot: Snapshot) -> None:
        self.taps.append(snapshot.positioning.taps)
        # what a snapshot carries is shown as well, by whoever looks into it
        for alarm in snapshot.alarms:
            self.alarm("", alarm)

    def put(self, news: CellNews) -> None:
        alarms = news.alarms if news.snapshot is None else news.snapshot.alarms
        self.on_page += [alarm for alarm in alarms if alarm.name == ALARM]

    def module(self, *_: object) -> None: ...

    def mark_bad(self, *_: object) -> None: ...


@pytest.fixture(scope="module")
def cell() -> CellConfig:
    read = read_cell(CONFIG / "cells" / "prototype.yaml")
    return replace(read, settings=read.settings.model_copy(update={"journal": None, "positioning": None}))


def named(alarms: tuple[Alarm, ...]) -> Alarm:
    return next(alarm for alarm in alarms if alarm.name == ALARM)


@pytest.fixture
async def running(
    cell: CellConfig, monkeypatch: pytest.MonkeyPatch
) -> Callable[[], tuple[CellTask, Thread, World]]:
    """Make cells with a shelved alarm, each with a thread of its own that stands still."""

    def make() -> tuple[CellTask, Thread, World]:
        task, thread, world = CellTask(cell), Thread(), World()
        task.worker._thread.shutdown()
        task.worker._thread = thread
        task._positioning = SimpleNamespace(state=PositioningState(), update_friction=lambda _snapshot: None)

        def step(*given: Any, **_more: Any) -> StepResult:
            _log, _design, state, capture, positioning, *_ = given
            state, _done = core.apply_event(state, ALARM, AlarmEvent(EventKind.COMMENT, comment="a cycle"))
            snapshot = replace(
                make_snapshot(capture, 0.2), positioning=positioning, alarms=state.alarms.alarms
            )
            return StepResult(state, snapshot, (), ())

        async def acknowledge(_cycle: object) -> None: ...

        monkeypatch.setattr("impactcell.service.worker.guarded_step", step)
        task._module.acknowledge = acknowledge
        for event in (EventKind.ACTIVATE, EventKind.SHELVE_TIMED):
            occurrence = AlarmEvent(event, time_ns=1, shelve_ns=10**18)
            task.worker._state, _ = core.apply_event(task.worker._state, ALARM, occurrence)
        task._publisher.server, task._publisher.feed = world, world
        task._publisher.publish_alarms(task.worker.alarms)
        task.worker.tell_alarms(task._publisher.publish_alarms)
        return task, thread, world

    return make


async def play(task: CellTask, thread: Thread, moves: str) -> list[Alarm]:
    """Play one order of moves, and then all that is left; the alarm after each piece of work."""
    capture, actions = make_capture(1), OperatorCommands({task.cell.name: task})
    cycle = asyncio.ensure_future(task._process(received(capture)))
    truth, going = [named(task.worker.alarms)], [cycle]
    for number, move in enumerate(moves + "JTT" * STEPS):
        task._positioning.state = PositioningState(taps=number)
        if move == "O":
            act = actions.act_on_condition(task.cell.name, ALARM, EventKind.UNSHELVE, ANNA)
            going.append(asyncio.ensure_future(act))
        elif move == "J":
            thread.step()
            truth.append(named(task.worker.alarms))
        else:
            await asyncio.sleep(0)
    await asyncio.gather(*going)
    return truth


def is_in_order(shown: list[Alarm], truth: list[Alarm]) -> bool:
    """Whether every state that was shown is the one before, or one that came after it."""
    at = 0
    for alarm in shown:
        later = next((i for i in range(at, len(truth)) if truth[i] is alarm), None)
        if later is None:
            return False
        at = later
    return truth[at] is truth[-1]


async def test_no_order_of_moves_shows_an_older_state_after_a_newer_one(
    running: Callable[[], tuple[CellTask, Thread, World]],
) -> None:
    """A cycle and an unshelving: J is a piece of the thread's work, T a turn of the loop, O the person."""
    for moves in itertools.product("JT", repeat=STEPS):
        for at in range(STEPS):
            order = "".join((*moves[:at], "O", *moves[at:]))
            task, thread, world = running()
            truth = await play(task, thread, order)
            assert is_in_order(world.alarms, truth), order
            assert is_in_order(world.on_page, truth), order
            assert world.taps == sorted(world.taps), order
            await task._module.close()


async def test_positioning_is_shown_as_it_is_then(
    running: Callable[[], tuple[CellTask, Thread, World]],
) -> None:
    task, thread, world = running()
    cycle = asyncio.ensure_future(task._process(received(make_capture(1))))
    for number in range(10):
        task._positioning.state = PositioningState(taps=number)
        thread.step()
        await asyncio.sleep(0)
        if world.taps:
            assert world.taps == [number]
            break
    assert world.taps
    await asyncio.wait_for(cycle, PATIENCE_S)


async def test_an_answer_to_an_activation_does_not_reach_the_next(cell: CellConfig) -> None:
    """The alarm goes and comes again while a person's acknowledgement is on its way."""
    task = CellTask(cell)
    actions, name = OperatorCommands({cell.name: task}), cell.name
    await task.worker.apply_rule_result(RuleResult(ALARM, holds=True), 1)
    seen = named(task.worker.alarms).activation
    await task.worker.apply_rule_result(RuleResult(ALARM, holds=False), 2)
    await task.worker.apply_rule_result(RuleResult(ALARM, holds=True), 3)
    now = named(task.worker.alarms)
    assert now.activation != seen
    with pytest.raises(RefusedError, match="BadEventIdUnknown"):
        await actions.act_on_condition(name, ALARM, EventKind.ACKNOWLEDGE, ANNA, activation=seen)
    assert not named(task.worker.alarms).acknowledged
    await actions.act_on_condition(name, ALARM, EventKind.ACKNOWLEDGE, ANNA, activation=now.activation)
    assert named(task.worker.alarms).acknowledged
    await task.close()
