"""Which of what the PLC shows as its target is a new one: neither a 0, nor what the service has looked at."""

import asyncio
from dataclasses import replace

import pytest

from impactcell.fieldbus.cycles.status_block import PositioningStatus
from impactcell.fieldbus.tap_commands import Objection
from impactcell.service.positioning import PositioningTask
from tests.told_module import Commander, ToldModule, block


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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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


async def test_a_target_that_was_withdrawn_while_the_module_executed_a_tap_is_not_begun(
    module: ToldModule, task: PositioningTask
) -> None:
    """The fastest tap for it was struck, though another had stood there for seconds."""
    commander = Commander(module, task)
    module.shown = block(state="executing", result="executing", target_m=0.03)
    await module.read_status()
    commander.rests.clear()
    begun = asyncio.create_task(task._read_plc_target())
    for _ in range(10):
        await asyncio.sleep(0)
    commander.show(state="ready", position_m=0.004, target_sequence=2, target_m=0.006)
    commander.rests.set()
    await begun
    assert not task.state.running
    assert task.fault is None
    await module.read_status()
    await task._read_plc_target()
    assert (task.state.running, task.state.target_m) == (True, 0.006)
    await task._drive()
    assert commander.struck_from[0] == 0.004
    assert [outcome.target_m for outcome in task.outcomes] == [0.006]


@pytest.mark.slow
@pytest.mark.parametrize("by_plc", [True, False])
async def test_no_tap_is_made_for_a_target_once_the_module_shows_another(
    module: ToldModule, task: PositioningTask, by_plc: bool
) -> None:
    """The PLC has set it while the parameters were written, or while the link was down."""
    commander = Commander(module, task)
    module.shown = block(target_sequence=int(by_plc))
    await module.read_status()
    await task._read_plc_target()
    if not by_plc:
        await task.begin(0.01)
    commander.before_strike = lambda: commander.show(target_sequence=2, target_m=0.02)
    await task._drive()
    assert commander.struck_from == []
    [outcome] = task.outcomes
    assert (outcome.settled, outcome.reason) == (False, "aborted by the PLC, which has a new target")
    assert task.fault is None
    await module.read_status()
    await task._read_plc_target()
    await task._drive()
    assert [outcome.settled for outcome in task.outcomes] == [False, True]
    assert task.outcomes[-1].target_m == 0.02


async def test_a_target_that_is_taken_back_right_before_a_tap_is_gone_on_with(
    module: ToldModule, task: PositioningTask
) -> None:
    commander = Commander(module, task)
    await module.read_status()
    await task._read_plc_target()
    commander.before_strike = lambda: commander.show(target_sequence=0)
    await task._drive()
    [outcome] = task.outcomes
    assert (outcome.settled, outcome.taps) == (True, len(commander.struck_from))
