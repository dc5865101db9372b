"""A PLC that takes a part away before the outcome of its last tap has been read."""

import asyncio

import pytest

from impactcell.fieldbus.cycles.status_block import PositioningStatus
from impactcell.fieldbus.tap_commands import Objection
from impactcell.service.positioning import PositioningTask
from tests.told_module import ToldModule, block


class Tapper:
    """Moves the part as foretold; the PLC puts another down after the first tap, or lets it lie."""

    def __init__(self, module: ToldModule, task: PositioningTask, *, taken_away: bool) -> None:
        self.module, self.task, self.taken_away, self.taps = module, task, taken_away, 0
        self.position_m = 0.0

    async def tap(self, _command: object, _objection: Objection) -> PositioningStatus:
        self.taps += 1
        tap = self.task._sequence.tap
        assert tap is not None
        self.position_m += tap.expected_m
        another = {"target_sequence": 2, "target_m": 0.02}
        self.module.shown = block(**another) if self.taken_away else block(position_m=self.position_m)
        assert self.module.shown.positioning is not None
        return self.module.shown.positioning


@pytest.mark.slow
@pytest.mark.parametrize("taken_away", [True, False])
async def test_the_next_part_is_not_taken_for_the_one_that_was_tapped(
    module: ToldModule, task: PositioningTask, taken_away: bool
) -> None:
    tapper = Tapper(module, task, taken_away=taken_away)
    task._positioner = tapper  # type: ignore[assignment]
    await module.read_status()
    await task._read_plc_target()
    await task._drive()
    [outcome] = task.outcomes
    assert outcome.taps == tapper.taps
    assert outcome.settled is not taken_away
    assert ("the PLC" in outcome.reason) is taken_away
    assert task.fault is None
    assert tapper.taps == 1 or not taken_away
    assert task.belief.taps == (0 if taken_away else tapper.taps)


async def test_a_target_that_came_while_the_link_was_down_is_begun_once_it_is_up(
    module: ToldModule, task: PositioningTask
) -> None:
    await module.read_status()
    module.connected = False
    await task._read_plc_target()
    assert task.fault is None
    assert not task.state.running
    module.connected = True
    await task._read_plc_target()
    assert task.state.running


async def test_a_refused_target_of_the_plc_ends_no_task_that_a_person_has_started_meanwhile(
    module: ToldModule, task: PositioningTask
) -> None:
    await module.read_status()
    await asyncio.gather(task.begin(0.005), task._read_plc_target())
    assert task.state.running
    assert task.state.target_m == 0.005
    assert task.fault is None
