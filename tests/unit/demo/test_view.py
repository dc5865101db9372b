"""The live view draws whatever a cell can be in, within its width."""

import io
import math
from dataclasses import replace

import pytest
from rich.console import Console

from impactcell.demo.chart import LEGEND, chart
from impactcell.demo.view import Scene, render
from impactcell.records import (
    Alarm,
    Coefficient,
    Estimator,
    FrictionEstimate,
    PositioningState,
    Quality,
    Snapshot,
)
from tests.snapshots import make_capture, make_snapshot


def drawn(snapshots: list[Snapshot], width: int = 100, height: int = 40, link: str = "connected") -> str:
    console = Console(width=width, file=io.StringIO(), record=True)
    scene = Scene(
        "press-1", "opc.tcp://127.0.0.1:4840 · password 0123456789ab", "wear grows", snapshots, link
    )
    console.print(render(scene, width, height))
    return console.export_text()


def history(count: int) -> list[Snapshot]:
    return [
        make_snapshot(make_capture(cycle, samples=8), mu_s=0.2 + 1e-4 * cycle)
        for cycle in range(1, count + 1)
    ]


def test_what_a_viewer_looks_for_is_there() -> None:
    last = history(30)[-1]
    shift = Alarm("BatchShift", active=True, acknowledged=False, cycle=21, message="shifted by +0.01")
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


def with_alarms(snapshot: Snapshot) -> Snapshot:
    shift = Alarm("BatchShift", active=True, acknowledged=False, cycle=21, message="by +0.01 " * 8)
    return replace(snapshot, alarms=(shift, *snapshot.alarms[1:]))


@pytest.mark.parametrize(("width", "height"), [(60, 24), (80, 24), (100, 24), (160, 50)])
def test_nothing_is_cut_off(width: int, height: int) -> None:
    text = drawn([*history(29), with_alarms(history(30)[-1])], width, height)
    assert len(text.splitlines()) <= height
    for whole in ("wear level", "0.2030 ± 0.0020", "signature", "BatchShift", "•", "0123456789ab"):
        assert whole in text
    assert "…" not in text


ENDPOINT = (
    "opc.tcp://127.0.0.1:4840/impactcell · page: http://127.0.0.1:8480 · user demo, password 0123456789ab"
)


@pytest.mark.parametrize(("width", "height"), [(80, 24), (60, 15), (120, 40), (80, 10), (60, 62)])
def test_many_alarms_push_nothing_out(width: int, height: int) -> None:
    last = history(30)[-1]
    alarms = tuple(
        replace(alarm, active=place > 1, acknowledged=False, cycle=21, message=f"by +0.01 {'since ' * 30}")
        for place, alarm in enumerate(last.alarms)
    )
    console = Console(width=width, file=io.StringIO(), record=True)
    scene = Scene(
        "press-1", ENDPOINT, "batch C is on the table", [*history(29), replace(last, alarms=alarms)]
    )
    console.print(render(scene, width, height))
    lines = console.export_text().splitlines()
    assert len(lines) <= height
    assert lines[-1].startswith("╰")
    text = " ".join(line.strip("│ ") for line in lines)
    for whole in (*ENDPOINT.split(), "Ctrl-C ends", "batch C is on the table"):
        assert whole in text
    assert lines[2].startswith("│ OPC UA:")
    assert ("•" in text) is (height >= 24)
    names = [alarm.name for alarm in (*alarms[2:], *alarms[:2])]
    places = [text.find(name) for name in names if name in text]
    assert places == sorted(places)
    assert "WearLimit cleared, unacknowledged since cycle 21: it said: by" in text or height < 62
    assert "ModelGap active, unacknowledged since cycle 21: by" in text or height < 62
    told = [place for place, line in enumerate(lines) if "since cycle 21" in line]
    if len(told) < len(alarms):
        assert f"+{len(alarms) - len(told)} more: " in lines[-2] or f"{len(alarms)} alarms: " in lines[-2]


def test_a_low_terminal_keeps_the_facts_and_does_without_the_chart() -> None:
    text = drawn(history(30), 80, 14)
    assert len(text.splitlines()) <= 14
    assert "signature" in text
    assert "░" not in text


def test_a_shift_is_marked_where_it_was_not_where_it_was_found() -> None:
    found = [
        replace(s, batch=replace(s.batch, last_shift=0.01, last_shift_cycle=8 if s.cycle < 15 else 9))
        if s.cycle >= 12
        else s
        for s in history(30)
    ]
    columns = {
        line.index("┆") for line in drawn(found).splitlines()[1:] if "┆" in line and "mu_s" not in line
    }
    first = len("│ │ ") + 8
    assert columns == {first + 9 - 1}


def test_the_band_is_as_wide_as_level_and_offset_are_unsure() -> None:
    """Level 0.2 ± 0.003, offset 0.02 ± 0.004 (one standard deviation each): 0.22 ± 0.01 (two) with both."""
    last = history(1)[0]
    wear = replace(last.wear, level=0.2, level_std=0.003)
    batch = replace(last.batch, offset=0.02, offset_std=0.004)
    friction = replace(last.friction, mu_s=replace(last.friction.mu_s, value=0.22))
    lines = chart([replace(last, wear=wear, batch=batch, friction=friction)], 1, 100).plain.splitlines()
    row_height = (float(lines[0][:8]) - float(lines[99][:8])) / 99
    assert sum(line[-1] in "░•" for line in lines) * row_height == pytest.approx(0.02, rel=0.05)
    assert "level+batch ± 2 sd" in LEGEND


def test_small_deviations_are_shown_with_the_decimals_that_they_need() -> None:
    last = history(1)[0]
    known = replace(last, friction=replace(last.friction, mu_k=Coefficient(0.1512345, 2e-5, Quality.GOOD)))
    assert "0.15123 ± 0.00004" in drawn([known])


def test_what_wear_and_batches_did_is_told_with_what_is_not_sure_of_it() -> None:
    last = history(1)[0]
    wear = replace(last.wear, rate_per_cycle=1e-6, rate_std=2e-7)
    batch = replace(last.batch, last_shift=-0.0255, last_shift_std=0.003, last_shift_cycle=9)
    text = drawn([replace(last, wear=wear, batch=batch)], 160)
    assert "+0.0010 ± 0.0004 per 1000 cycles" in text
    assert "shifted -0.0255 ± 0.0060 at cycle 9" in text


def test_a_positioning_cell_shows_its_task() -> None:
    (snapshot,) = history(1)
    assert "remaining" not in drawn([snapshot])
    task = PositioningState(target_m=0.01, remaining_m=8.277e-3)
    for width in (80, 120):
        assert "10.00 mm, remaining 8.277 mm" in drawn([replace(snapshot, positioning=task)], width)


def test_nobody_is_told_to_connect_to_a_cell_that_has_ended() -> None:
    text = drawn(history(3), link="")
    assert "ended" in text
    assert "opc.tcp" not in text


@pytest.mark.parametrize("width", [60, 100, 160])
@pytest.mark.parametrize("count", [0, 1, 300])
def test_any_width_any_history(width: int, count: int) -> None:
    assert max(map(len, drawn(history(count), width).splitlines())) <= width


def test_nothing_known_is_drawn_as_such() -> None:
    snapshot = make_snapshot(make_capture(1, samples=8))
    blank = replace(
        snapshot,
        friction=FrictionEstimate(
            *[Coefficient(reason="clipped")] * 5,
            Estimator.NONE,
            peak_force_n=math.nan,
            sliding_distance_m=math.nan,
        ),
        wear=replace(
            snapshot.wear, level=math.nan, level_std=math.nan, cycles_to_limit=math.nan, quality=Quality.BAD
        ),
        batch=replace(snapshot.batch, offset=math.nan),
    )
    text = drawn([blank])
    assert "no usable estimate yet" in text
    assert "none: clipped" in text
    assert "nan" not in text
    assert "by none" not in text


def test_a_limit_that_was_passed_is_said_to_be() -> None:
    (snapshot,) = history(1)
    there = replace(snapshot.wear, limit=0.24, cycles_to_limit=0.0, cycles_to_limit_low=0.0)
    assert "0.240, passed" in drawn([replace(snapshot, wear=there)])
    soon = replace(there, cycles_to_limit=12.0, cycles_to_limit_low=8.0, cycles_to_limit_high=19.0)
    assert "0.240 in 12 (8 to 19) cycles" in drawn([replace(snapshot, wear=soon)])
    open_end = replace(soon, cycles_to_limit_low=8765.4, cycles_to_limit_high=math.inf)
    assert "0.240 in more than 8760 cycles" in drawn([replace(snapshot, wear=open_end)])


def test_before_the_first_cycle_it_says_how_long_and_what_is_waited_for() -> None:
    console = Console(width=100, file=io.StringIO(), record=True)
    for compiles in (False, True):
        console.print(render(Scene("press-1", "", "", [], "not connected", 34.2, compiles=compiles)))
    text = console.export_text()
    assert text.count("waiting for the first cycle for 34 s: not connected ") == 1
    assert text.count("waiting for the first cycle for 34 s: compiling for this machine, once") == 1
