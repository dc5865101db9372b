"""A positioning task that is aborted, replaced, interrupted or begun again: nothing is struck unasked."""

import asyncio
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from impactcell.errors import FieldbusError, LinkError, PositioningError
from impactcell.fieldbus.cycles.status_block import PositioningStatus, StatusBlock
from impactcell.fieldbus.tap_commands import Objection, ObjectionError
from impactcell.service.factory import cell_design
from impactcell.service.positioning import PositioningTask
from impactcell.service.publisher import CellPublisher
from impactcell.settings import CellConfig
from tests.snapshots import make_capture, make_snapshot
from tests.told_module import ToldModule, block, task_of, worker_of

OPERATOR = "anna"


class Striker:
    """Strikes as asked, and moves the part as foretold; a tap may be held up until a test lets it go on."""

    def __init__(self, module: ToldModule, task: PositioningTask) -> None:
        self.module, self.task = module, task
        self.taps, self.position_m, self.sequence = 0, 0.0, 1
        self.began, self.goes_on = asyncio.Event(), asyncio.Event()
        self.goes_on.set()
        self.fault: Exception | None = None
        self.abort_fault: FieldbusError | None = None
        task._positioner = self  # type: ignore[assignment]

    async def tap(self, _command: object, objection: Objection) -> PositioningStatus:
        tap = self.task._sequence.tap
        assert tap is not None
        self.began.set()
        await self.goes_on.wait()
        if self.fault is not None:
            raise self.fault
        report = await self.read_report_at_rest()
        if objection(report):
            raise ObjectionError("nothing has been commanded", report)
        self.taps += 1
        self.position_m += tap.expected_m * tap.direction
        self.show()
        return await self.read_report_at_rest()

    def show(self, **more: Any) -> None:
        self.module.shown = block(position_m=self.position_m, target_sequence=self.sequence, **more)

    async def read_report_at_rest(self) -> PositioningStatus:
        shown: StatusBlock = await self.module.read_status()
        assert shown.positioning is not None
        return shown.positioning

    async def abort(self) -> None:
        if self.abort_fault is not None:
            raise self.abort_fault


async def test_an_abort_while_the_first_tap_is_being_planned_leaves_none(
    module: ToldModule, task: PositioningTask
) -> None:
    striker = Striker(module, task)
    await module.read_status()
    begun = asyncio.create_task(task.begin(0.01))
    await asyncio.sleep(0)
    await task.abort(OPERATOR)
    with pytest.raises(PositioningError, match="aborted"):
        await begun
    await task._drive()
    assert (striker.taps, task.state.running, task.fault) == (0, False, None)


async def test_an_abort_while_the_target_of_the_plc_is_being_planned_is_no_fault(
    module: ToldModule, task: PositioningTask
) -> None:
    striker = Striker(module, task)
    await module.read_status()
    begun = asyncio.create_task(task._read_plc_target())
    await asyncio.sleep(0)
    await task.abort(OPERATOR)
    await begun
    await task._drive()
    assert (striker.taps, task.state.running, task.fault) == (0, False, None)


async def with_a_tap_under_way(
    module: ToldModule, task: PositioningTask, target_m: float
) -> tuple["Striker", asyncio.Task[None]]:
    """Begin a task whose first tap goes on once its striker's `goes_on` is set."""
    striker = Striker(module, task)
    await module.read_status()
    await task.begin(target_m)
    striker.goes_on.clear()
    driven = asyncio.create_task(task._drive())
    await striker.began.wait()
    return striker, driven


async def test_an_abort_before_the_command_is_written_means_that_nothing_is_struck(
    module: ToldModule, task: PositioningTask
) -> None:
    striker, driven = await with_a_tap_under_way(module, task, 0.01)
    striker.abort_fault = LinkError("no answer")
    with pytest.raises(PositioningError, match="no further tap is commanded"):
        await task.abort(OPERATOR)
    striker.goes_on.set()
    await driven
    assert (striker.taps, task.state.running, task.fault) == (0, False, None)
    assert task.state.reason == f"aborted by {OPERATOR}"


@pytest.mark.parametrize("finished", [True, False])
async def test_what_remains_after_an_abort_is_from_where_its_tap_has_left_the_part(
    module: ToldModule, task: PositioningTask, *, finished: bool
) -> None:
    """Whether the module finished that tap or stopped it; until it is at rest nothing is known."""
    striker, driven = await with_a_tap_under_way(module, task, 0.02)
    assert task.state.remaining_m == pytest.approx(0.02)
    await task.abort(OPERATOR)
    assert math.isnan(task.state.remaining_m)
    assert task.state.target_m == 0.02
    striker.position_m = 0.0035
    striker.show()
    if not finished:
        striker.fault = PositioningError("tap 1: aborted")
    striker.goes_on.set()
    await driven
    assert task.state.remaining_m == pytest.approx(0.0165)
    assert (task.state.running, task.fault) == (False, None)
    await task.begin(0.01)
    assert task.state.remaining_m == pytest.approx(0.0065)


async def test_what_remains_after_an_abort_is_not_known_where_the_module_does_not_say(
    module: ToldModule, task: PositioningTask
) -> None:
    striker, driven = await with_a_tap_under_way(module, task, 0.02)
    await task.abort(OPERATOR)

    async def not_at_rest() -> PositioningStatus:
        raise PositioningError("the module has not been ready for 10 s")

    striker.read_report_at_rest = not_at_rest  # type: ignore[method-assign]
    striker.goes_on.set()
    await driven
    assert math.isnan(task.state.remaining_m)
    assert (task.state.running, task.fault) == (False, None)


async def test_what_remains_after_a_fault_is_from_where_its_tap_has_left_the_part(
    module: ToldModule, task: PositioningTask
) -> None:
    """It is not known until the module says where the part lies at rest."""
    striker, driven = await with_a_tap_under_way(module, task, 0.02)
    asked, answers = asyncio.Event(), asyncio.Event()

    async def at_rest_later() -> PositioningStatus:
        asked.set()
        await answers.wait()
        assert striker.module.shown.positioning is not None
        return striker.module.shown.positioning

    striker.read_report_at_rest = at_rest_later  # type: ignore[method-assign]
    striker.fault = PositioningError("tap not finished within 10 s; the part may have been struck")
    striker.goes_on.set()
    await asked.wait()
    assert task.fault is not None
    assert math.isnan(task.state.remaining_m)
    striker.position_m = 0.0035
    striker.show()
    answers.set()
    await driven
    assert task.state.remaining_m == pytest.approx(0.0165)
    assert (task.state.running, task.fault[0]) == (False, str(striker.fault))


async def test_what_remains_after_a_fault_is_not_known_where_the_module_does_not_say(
    module: ToldModule, task: PositioningTask
) -> None:
    striker, driven = await with_a_tap_under_way(module, task, 0.02)

    async def not_read() -> PositioningStatus:
        raise PositioningError("the module has not been read for 10 s")

    striker.read_report_at_rest = not_read  # type: ignore[method-assign]
    striker.fault = PositioningError("tap not finished within 10 s; the part may have been struck")
    striker.goes_on.set()
    await driven
    assert task.fault is not None
    assert math.isnan(task.state.remaining_m)


@pytest.mark.parametrize("abort_fault", [None, LinkError("no answer")])
async def test_the_next_target_waits_until_the_tap_of_the_one_before_has_ended(
    module: ToldModule, task: PositioningTask, abort_fault: FieldbusError | None
) -> None:
    """It begins where the part has come to rest, and is not ended by what became of that tap."""
    striker = Striker(module, task)
    striker.abort_fault = abort_fault
    await module.read_status()
    await task._read_plc_target()
    striker.goes_on.clear()
    driven = asyncio.create_task(task._drive())
    await striker.began.wait()
    striker.sequence = 2
    striker.show(target_m=0.02)
    await module.read_status()
    another = asyncio.create_task(task._read_plc_target())
    await asyncio.sleep(0)
    assert not another.done()
    striker.position_m = 0.003
    striker.show(target_m=0.02)
    striker.fault = PositioningError("tap 1: aborted")
    striker.goes_on.set()
    await asyncio.gather(driven, another)
    assert task.fault is None
    assert task.state.running
    assert task.state.target_m == 0.02
    assert task.state.remaining_m == pytest.approx(0.017)


async def test_a_task_whose_tap_a_fault_of_the_cell_has_interrupted_is_over_and_says_so(
    module: ToldModule, task: PositioningTask
) -> None:
    striker = Striker(module, task)
    module.shown = block(target_sequence=0)
    await module.read_status()
    await task.begin(0.01)
    striker.goes_on.clear()
    running = asyncio.create_task(task.run())
    await striker.began.wait()
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)
    assert task.state.running
    again = asyncio.create_task(task.run())
    await asyncio.sleep(0)
    assert not task.state.running
    assert task.fault is not None
    assert "interrupted during tap 1; set the target again" in task.fault[0]
    again.cancel()
    await asyncio.gather(again, return_exceptions=True)
    assert striker.taps == 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ends", "session", "begins"),
    [("settled", 1, False), ("aborted", 1, False), ("faulted", 1, False), ("settled", 2, True),
     ("settled", 0, True), ("not at all", 1, True)],
)  # fmt: skip
async def test_a_target_that_is_done_with_is_not_carried_out_again_after_a_restart(
    tmp_path: Path, cell: CellConfig, ends: str, session: int, begins: bool
) -> None:
    """A module that was started anew, or says no session, may mean another part by the same number."""
    module, first = ToldModule.of(cell), worker_of(cell, tmp_path / "j")
    module.shown = replace(module.shown, session=min(session, 1))
    await module.read_status()
    task = task_of(cell, module, first)
    striker = Striker(module, task)
    await task._read_plc_target()
    if ends == "faulted":
        striker.fault = PositioningError("refused")
    if ends == "aborted":
        await task.abort(OPERATOR)
    elif ends != "not at all":
        await task._drive()
    assert task.state.running is (ends == "not at all")
    await first.record()
    await first.close()
    second = worker_of(cell, tmp_path / "j")
    module.shown = replace(block(position_m=0.002), session=session)
    await module.read_status()
    task = task_of(cell, module, second)
    await task._read_plc_target()
    assert task.state.running is begins
    module.shown = replace(block(position_m=0.002, target_sequence=2), session=session)
    await module.read_status()
    await task._read_plc_target()
    assert task.state.running
    await second.close()


async def test_a_reload_takes_over_limits_and_mass(
    module: ToldModule, task: PositioningTask, cell: CellConfig
) -> None:
    Striker(module, task)
    module.shown = block(mass_kg=float("nan"))
    await module.read_status()
    with pytest.raises(PositioningError, match="the mass of the part is not known"):
        await task.begin(0.01)
    settings = cell.settings
    actuator = settings.actuator.model_copy(update={"max_velocity_mm_per_min": 600.0, "max_stroke_mm": 0.4})
    part = settings.part.model_copy(update={"mass_kg": 18.9})
    slower = replace(cell, settings=settings.model_copy(update={"actuator": actuator, "part": part}))
    learned = task.belief
    await task.redesign(slower, cell_design(slower))
    assert task.belief.taps == learned.taps
    assert task._worker.belief is None, "nothing has been learned that a restart should go on from"
    await task.begin(0.01)
    assert 0.0 < task.state.next_velocity_m_s <= 0.01 * (1.0 + 1e-9)
    assert 0.0 < task.state.next_stroke_m <= 0.4e-3 * (1.0 + 1e-9)


def test_a_task_that_changes_says_nothing_of_the_values_of_the_last_cycle(
    monkeypatch: pytest.MonkeyPatch, task: PositioningTask, cell: CellConfig
) -> None:
    told: list[dict[str, Any]] = []
    publisher = CellPublisher(cell.name, (), lambda: task.state, None)  # type: ignore[arg-type]
    monkeypatch.setattr(publisher, "_put", lambda **news: told.append(news))
    publisher.publish_positioning(make_snapshot(make_capture(3)))
    (news,) = told
    assert set(news) == {"snapshot"}
    assert news["snapshot"].positioning.predictions is task.state.predictions
