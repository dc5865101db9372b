"""Which of what the PLC shows as its target is a new one: neither a 0, nor what the service has looked at."""

from dataclasses import replace

import pytest

from impactcell.fieldbus.status_block import PositioningStatus
from impactcell.fieldbus.tap_commands import Objection
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

    async def tap(self, _command: object, _objection: Objection) -> PositioningStatus:
        self.taps += 1
        tap = self.task._sequence.tap
        assert tap is not None
        self.position_m += tap.expected_m
        self.module.shown = block(position_m=self.position_m, target_sequence=self.sequence)
        if self.looked_at:
            await self.module.read_status()
            await self.task._read_plc_target()
        return await self.read_report_at_rest()

    async def read_report_at_rest(self) -> PositioningStatus:
        shown = (await self.module.read_status()).positioning
        assert shown is not None
        return shown


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


@pytest.mark.parametrize(
    ("session", "target_m", "begins"), [(1, 0.02, False), (2, 0.02, True), (2, 0.01, False)]
)
async def test_the_first_target_of_a_module_that_was_started_anew_is_a_new_one(
    module: ToldModule, task: PositioningTask, session: int, target_m: float, begins: bool
) -> None:
    """Nothing began, and nothing said why: its number was that of one done with in the session before.

    The same place under the same number is what a PLC that writes all the time, or a module that keeps its
    registers, shows without anybody having asked for it: the part may lie anywhere by now.
    """
    await settled(module, task)
    assert task.state.target_m == 0.01
    module.shown = replace(block(target_m=target_m), session=session)
    await module.read_status()
    await task._read_plc_target()
    assert task.state.running is begins
    if not begins:
        module.shown = replace(block(target_m=target_m, target_sequence=2), session=session)
        await module.read_status()
        await task._read_plc_target()
        assert task.state.running


async def test_a_target_that_a_module_that_was_started_anew_shows_again_is_told(
    module: ToldModule, task: PositioningTask, caplog: pytest.LogCaptureFixture
) -> None:
    await settled(module, task)
    for sequence in (0, 1, 1):  # until the PLC has written it anew
        module.shown = replace(block(target_sequence=sequence), session=2)
        await module.read_status()
        await task._read_plc_target()
    assert not task.state.running
    [told] = [text for text in caplog.messages if "was started anew" in text]
    assert "until target_sequence is raised" in told
    assert task._worker.handled_target == (2, 1), "nor after a restart of the service"
