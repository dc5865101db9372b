"""A part that has moved since its tap was planned: the tap is planned anew from where the part lies."""

import asyncio
import math

import pytest

from impactcell.positioning.task_state_machine import MOST_REPLANS
from impactcell.service.cell_planner import SAME_PLACE
from impactcell.service.positioning import PositioningTask
from tests.told_module import Commander, ToldModule, block

TOLERANCE_M = 50e-6


@pytest.mark.parametrize("lies_m", [0.004, 0.012, 0.00998])
async def test_a_tap_is_planned_anew_from_where_an_earlier_tap_has_left_the_part(
    module: ToldModule, task: PositioningTask, lies_m: float
) -> None:
    """It was struck from there as planned from 0, and learned from as if it had begun at 0."""
    commander = Commander(module, task)
    await module.read_status()
    await task._read_plc_target()
    commander.before_strike = lambda: commander.show(position_m=commander.shown.position_m or lies_m)
    await task._drive()
    [outcome] = task.outcomes
    assert (outcome.settled, outcome.reason, task.fault) == (True, "in place", None)
    assert outcome.position_m == pytest.approx(0.01, abs=TOLERANCE_M)
    assert outcome.taps == len(commander.struck_from) == task.belief.taps
    assert commander.struck_from[:1] == ([] if abs(lies_m - 0.01) < TOLERANCE_M else [lies_m])


async def test_a_task_begins_where_the_part_lies_once_a_tap_of_before_has_ended(
    module: ToldModule, task: PositioningTask
) -> None:
    """A service that was started anew, or had given a tap up, finds the module executing.

    The part seemed to be in place already where the tap under way had begun at the target.
    """
    commander = Commander(module, task)
    module.shown = block(state="executing", result="executing", target_m=0.0)
    await module.read_status()
    commander.rests.clear()
    begun = asyncio.create_task(task._read_plc_target())
    for _ in range(10):
        await asyncio.sleep(0)
    assert not begun.done()
    assert not task.outcomes
    commander.show(state="ready", result="done", position_m=0.004)
    commander.rests.set()
    await begun
    assert task.state.running
    assert task.state.remaining_m == pytest.approx(-0.004)
    await task._drive()
    assert commander.struck_from[0] == 0.004
    assert [outcome.settled for outcome in task.outcomes] == [True]


async def test_a_part_that_never_rests_is_not_struck_and_ends_with_a_fault_that_says_so(
    module: ToldModule, task: PositioningTask
) -> None:
    commander = Commander(module, task)
    await module.read_status()
    await task._read_plc_target()
    commander.before_strike = lambda: commander.show(position_m=commander.shown.position_m + 2e-4)
    await task._drive()
    assert commander.struck_from == []
    assert task.fault is not None
    assert f"the part has moved {MOST_REPLANS + 1} times before tap 1 was made" in task.fault[0]
    assert task.belief.taps == 0


async def test_a_position_that_is_no_longer_known_is_a_fault(
    module: ToldModule, task: PositioningTask
) -> None:
    commander = Commander(module, task)
    await module.read_status()
    await task._read_plc_target()
    commander.before_strike = lambda: commander.show(position_m=math.nan)
    await task._drive()
    assert commander.struck_from == []
    assert task.fault is not None
    assert "the position of the part is not known" in task.fault[0]


@pytest.mark.parametrize("share", [-0.99, 0.99, 1.01])
async def test_readings_of_a_part_at_rest_may_scatter(
    module: ToldModule, task: PositioningTask, share: float
) -> None:
    """By half the tolerance; only what is more than that is planned for anew."""
    commander = Commander(module, task)
    await module.read_status()
    await task._read_plc_target()
    reads_m = share * SAME_PLACE * TOLERANCE_M
    asked = []
    commander.before_strike = lambda: (
        asked.append(task.state.taps),
        commander.show(position_m=commander.shown.position_m or reads_m),
    )
    await task._drive()
    assert commander.struck_from[0] == reads_m
    assert len(asked) - len(commander.struck_from) == (share > 1.0)
    assert task.fault is None


@pytest.mark.parametrize("another", [True, False])
async def test_a_tap_in_doubt_is_not_planned_anew(
    module: ToldModule, task: PositioningTask, another: bool
) -> None:
    """A request to strike was not answered, and the part has moved; a new target of the PLC is no fault."""
    commander = Commander(module, task)
    await module.read_status()
    await task._read_plc_target()
    commander.sent = True
    commander.before_strike = lambda: commander.show(position_m=0.004, target_sequence=1 + another)
    await task._drive()
    [outcome] = task.outcomes
    assert (commander.struck_from, outcome.settled) == ([], False)
    assert ("the PLC" in outcome.reason) is another
    assert (task.fault is None) is another
    assert outcome.reason.endswith("; the part may have been struck") is not another
