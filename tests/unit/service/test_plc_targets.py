"""Which of what the PLC shows as its target is a new one: neither a 0, nor what the service has looked at."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from impactcell.fieldbus.status_block import PositioningStatus
from impactcell.service.positioning import PositioningTask
from tests.told_module import ToldModule, block


class Tapper:
    """Moves the part as foretold; the PLC shows `sequence` from the first tap on."""

    def __init__(
        self, module: ToldModule, task: PositioningTask, sequence: int, *, looked_at: bool = False
    ) -> None:
        self.module, self.task, self.sequence, self.looked_at = module, task, sequence, looked_at
        self.taps, self.position_m = 0, 0.0
        task._positioner = self  # type: ignore[assignment]

    async def tap(self, _command: object, _is_wanted: Callable[[], bool]) -> int:
        self.taps += 1
        tap = self.task._sequence.tap
        assert tap is not None
        self.position_m += tap.expected_m
        self.module.shown = block(position_m=self.position_m, target_sequence=self.sequence)
        if self.looked_at:
            await self.module.read_status()
            await self.task._read_plc_target()
        return self.taps

    async def read_report(self) -> PositioningStatus:
        shown = (await self.module.read_status()).positioning
        assert shown is not None
        return shown

    read_report_at_rest = read_report


@pytest.mark.parametrize("looked_at", [True, False])
async def test_a_request_that_is_taken_back_during_a_tap_goes_on(
    module: ToldModule, task: PositioningTask, looked_at: bool
) -> None:
    """It was aborted, without an alarm, where the report after the tap saw the 0 first."""
    tapper = Tapper(module, task, 0, looked_at=looked_at)
    await module.read_status()
    await task._read_plc_target()
    await task._drive()
    [outcome] = task.outcomes
    assert (outcome.settled, outcome.taps, task.fault) == (True, tapper.taps, None)
    await task._read_plc_target()
    assert not task.state.running
    module.shown = block(position_m=tapper.position_m, target_m=0.02)
    await module.read_status()
    await task._read_plc_target()
    assert (task.state.running, task.state.target_m) == (True, 0.02)  # the same number, after a 0


async def settled(module: ToldModule, task: PositioningTask) -> None:
    """Carry out target 1 of session 1."""
    await module.read_status()
    await task._read_plc_target()
    Tapper(module, task, 1)
    await task._drive()
    [outcome] = task.outcomes
    assert outcome.settled


@pytest.mark.parametrize(("session", "begins"), [(1, False), (2, True)])
async def test_the_first_target_of_a_module_that_was_started_anew_is_a_new_one(
    module: ToldModule, task: PositioningTask, session: int, begins: bool
) -> None:
    """Nothing began, and nothing said why: its number was that of one done with in the session before."""
    await settled(module, task)
    module.shown = replace(block(target_m=0.02), session=session)
    await module.read_status()
    await task._read_plc_target()
    assert task.state.running is begins
    assert task.fault is None
    if begins:
        assert task.state.target_m == 0.02
