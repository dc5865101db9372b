"""The live view draws whatever a cell can be in, within its width."""

import io
import math
from dataclasses import replace

import pytest
from rich.console import Console

from impactcell.demo.view import Scene, render
from impactcell.records import Alarm, AlarmName, Coefficient, Quality, Snapshot
from tests.snapshots import make_capture, make_snapshot


def drawn(snapshots: list[Snapshot], width: int = 100) -> str:
    console = Console(width=width, file=io.StringIO(), record=True)
    console.print(render(Scene("press-1", "opc.tcp://127.0.0.1:4840", "wear grows", snapshots), width))
    return console.export_text()


def history(count: int) -> list[Snapshot]:
    return [
        make_snapshot(make_capture(cycle, samples=8), mu_s=0.2 + 1e-4 * cycle)
        for cycle in range(1, count + 1)
    ]


def test_what_a_viewer_looks_for_is_there() -> None:
    last = history(30)[-1]
    shift = Alarm(
        AlarmName.BATCH_SHIFT, active=True, acknowledged=False, cycle=21, message="shifted by +0.01"
    )
    alarmed = replace(last, alarms=(shift, *last.alarms[1:]))
    text = drawn([*history(29), alarmed])
    for expected in (
        "press-1",
        "cycle 30",
        "opc.tcp://127.0.0.1:4840",
        "BatchShift",
        "shifted by +0.01",
        "0.2030",
        "•",
        "░",
    ):
        assert expected in text
    assert "no alarms" not in text


@pytest.mark.parametrize("width", [60, 100, 160])
@pytest.mark.parametrize("count", [0, 1, 300])
def test_any_width_any_history(width: int, count: int) -> None:
    assert max(map(len, drawn(history(count), width).splitlines())) <= width


def test_nothing_known_is_drawn_as_such() -> None:
    snapshot = make_snapshot(make_capture(1, samples=8))
    blank = replace(
        snapshot,
        friction=replace(snapshot.friction, mu_s=Coefficient(reason="clipped"), mu_k=Coefficient()),
        wear=replace(
            snapshot.wear, level=math.nan, level_std=math.nan, cycles_to_limit=math.nan, quality=Quality.BAD
        ),
        batch=replace(snapshot.batch, offset=math.nan),
    )
    text = drawn([blank])
    assert "no usable estimate yet" in text
    assert "none" in text
