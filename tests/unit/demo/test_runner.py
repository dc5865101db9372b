"""When a demo is over."""

import asyncio
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import pytest

from impactcell.demo import runner
from impactcell.demo.scenario_setup import DemoSetup, last_target_m
from impactcell.errors import ImpactCellError
from impactcell.records import PositioningState
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
