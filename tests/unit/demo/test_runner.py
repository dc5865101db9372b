"""When a demo is over."""

import asyncio
import contextlib
import math
import signal
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from impactcell.demo import runner
from impactcell.demo.scenario_setup import DemoSetup, last_target_m
from impactcell.errors import ImpactCellError
from impactcell.process.signals import ends_of_terminal, stop_on_signals
from impactcell.records import Coefficient, PositioningState
from tests.snapshots import make_capture, make_snapshot
from tests.virtual_time import run_virtually

TASKS = {"positioning": {"tasks": [{"target_m": 0.01}, {"target_m": 0.005}]}}


@pytest.mark.parametrize(
    ("content", "target_m", "over"),
    [(TASKS, 0.005000000222, True), (TASKS, 0.01, False), ({}, math.nan, False)],
)
def test_a_demo_with_a_last_part_ends_with_it(
    content: dict[str, object], target_m: float, over: bool
) -> None:
    stage = cast("DemoSetup", SimpleNamespace(last_target_m=last_target_m(content)))
    playing = runner._DemoRun(stage, cycles=None)
    state = PositioningState(target_m=target_m)
    playing.snapshots.append(replace(make_snapshot(make_capture(7)), positioning=state))

    async def watched() -> tuple[bool, bool]:
        stop = asyncio.Event()
        watch = asyncio.create_task(playing._watch(asyncio.Event(), stop))
        await asyncio.wait({watch}, timeout=10.0 * runner.QUIET_S)
        watch.cancel()
        return watch.done(), stop.is_set()

    assert run_virtually(watched()) == (over, over)
    assert playing.messages == ([(7, "that was the last part")] if over else [])


@pytest.fixture
def kept_signals() -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # the tests themselves may run under nohup
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def setting_up(monkeypatch: pytest.MonkeyPatch, *signals: signal.Signals) -> list[str]:
    """Have a demo met by signals while it is set up; the list tells what was done."""
    done: list[str] = []

    @contextlib.contextmanager
    def set_up(*_: object) -> Iterator[None]:
        try:
            for number in signals:
                signal.raise_signal(number)
            yield
        finally:
            for number in (signal.SIGHUP, signal.SIGTERM):  # a second one does not stop the tidying up
                signal.raise_signal(number)
            done.append("put away")

    monkeypatch.setattr(runner, "set_up_scenario", set_up)
    return done


@pytest.mark.usefixtures("kept_signals")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_demo_that_is_ended_while_it_is_set_up_leaves_nothing_behind(
    monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    done = setting_up(monkeypatch, number)
    with pytest.raises(SystemExit) as ended:
        runner.demo(cycles=None, scenario="demo", as_json=True)
    assert (ended.value.code, done) == (0, ["put away"])


@pytest.mark.usefixtures("kept_signals")
@pytest.mark.parametrize("ignored", [False, True])
def test_a_demo_ends_with_its_terminal_unless_nohup_keeps_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], ignored: bool
) -> None:
    done = setting_up(monkeypatch)
    signal.signal(signal.SIGHUP, signal.SIG_IGN if ignored else signal.SIG_DFL)
    ended_by: list[signal.Signals] = []

    async def follow(self: object, draw: object) -> bool:
        stop = asyncio.Event()
        with stop_on_signals(stop, *ends_of_terminal()) as received:
            signal.raise_signal(signal.SIGHUP)
            if ignored:
                signal.raise_signal(signal.SIGTERM)
            await stop.wait()
        ended_by.extend(received)
        return False

    monkeypatch.setattr(runner._DemoRun, "follow", follow)
    monkeypatch.setattr(runner._DemoRun, "summary", lambda _: {})
    runner.demo(cycles=None, scenario="demo", as_json=True)
    assert ended_by == [signal.SIGTERM if ignored else signal.SIGHUP]
    assert (done, capsys.readouterr().out) == (["put away"], "{}\n")


@pytest.mark.parametrize("seen", [0, 1])
async def test_the_first_cycle_is_waited_for_longer_than_the_next(
    monkeypatch: pytest.MonkeyPatch, seen: int
) -> None:
    monkeypatch.setattr(runner, "PATIENCE_S", 0.02)
    monkeypatch.setattr(runner, "FIRST_PATIENCE_S", 0.03)
    stage = cast("DemoSetup", SimpleNamespace(last_target_m=math.nan))
    playing = runner._DemoRun(stage, cycles=5)
    playing.snapshots.extend(make_snapshot(make_capture(cycle)) for cycle in range(1, 1 + seen))
    with pytest.raises(
        ImpactCellError, match=f"no cycle for {0.02 if seen else 0.03} s: the module is silent"
    ):
        await playing._watch(asyncio.Event(), asyncio.Event())


def test_a_line_says_none_of_what_is_not_known(capsys: pytest.CaptureFixture[str]) -> None:
    """It said "mu_s nan ± nan", and a batch without a name was nothing after a space."""
    snapshot = make_snapshot(make_capture(7, samples=8))
    unknown = replace(snapshot.friction, mu_s=Coefficient(reason="clipped"))
    blank = replace(snapshot, friction=unknown, batch=replace(snapshot.batch, batch_id=""), alarms=())
    runner._print_line(cast("Any", None), blank)
    assert capsys.readouterr().out == "cycle 7: mu_s none: clipped, batch unnamed\n"
