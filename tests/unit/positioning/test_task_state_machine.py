"""The state machine of a task: what is refused, what stops it, and that nothing else can happen."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.errors import PositioningError
from impactcell.numerics.raster import Raster
from impactcell.positioning import SafetyLimits, Tap, TapPlanner
from impactcell.positioning.safety_limits import check_tap
from impactcell.positioning.task_state_machine import (
    MOST_REPLANS,
    MOST_TAPS,
    PositioningCell,
    TaskPhase,
    TaskState,
    aborted,
    begin_task,
    commanded,
    failed,
    observed,
    replan,
)
from impactcell.records import LARGEST_STATISTIC

LIMITS = SafetyLimits(velocity_m_s=0.1, stroke_m=1.5e-3, travel_m=(0.0, 60e-3))
CELL = PositioningCell("press 3", LIMITS, resolution_m=1e-6)
GOOD = {"target_m": 20e-3, "position_m": 2e-3, "mass_kg": 12.0, "trained": True}


def planner() -> TapPlanner:
    made = TapPlanner(tolerance_m=50e-6)
    made.observe_friction(0.19, 0.004)
    return made


def test_a_cell_whose_registers_only_command_more_than_its_limits_makes_no_tap() -> None:
    for coarse in (
        {"velocity_raster": Raster(0.2, 0.2, 10.0), "max_velocity_m_s": 0.2},
        {"stroke_raster": Raster(2e-3, 2e-3, 1.0), "max_stroke_m": 2e-3},
    ):
        made = TapPlanner(tolerance_m=50e-6, **coarse)
        made.observe_friction(0.19, 0.004)
        with pytest.raises(PositioningError, match=r"press 3: a (tap|stroke) .*is not allowed, the limit is"):
            begin_task(TaskState(), CELL, made, **GOOD)


def waiting() -> tuple[TaskState, TapPlanner]:
    made = planner()
    return commanded(begin_task(TaskState(), CELL, made, **GOOD)), made


def test_a_task_from_start_to_end() -> None:
    made = planner()
    sequence = begin_task(TaskState(), CELL, made, **GOOD)
    assert sequence.phase is TaskPhase.COMMANDING
    while sequence.running:
        assert sequence.tap is not None
        state = sequence.published()
        assert state.running
        assert state.next_velocity_m_s == sequence.tap.velocity_m_s
        sequence = commanded(sequence)
        assert sequence.phase is TaskPhase.WAITING
        sequence = observed(sequence, CELL, made, sequence.position_m + sequence.tap.expected_m)
    assert sequence.phase is TaskPhase.SETTLED
    assert abs(sequence.remaining_m) <= 50e-6
    assert made.posterior.taps == sequence.taps == sequence.published().taps


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"target_m": 1e-3}, "lies behind the part"),
        ({"target_m": 61e-3}, "beyond the travel"),
        ({"target_m": -1e-3}, "beyond the travel"),
        ({"target_m": math.nan}, "must be a position"),
        ({"position_m": math.nan}, "position of the part is not known"),
        ({"mass_kg": math.nan}, "mass of the part is not known"),
        ({"mass_kg": 0.0}, "mass of the part is not known"),
        ({"trained": False}, "friction is not known yet"),
        ({"mass_kg": 5000.0}, "moves a part of 5000.0 kg"),
    ],
)
def test_refuses_with_the_reason(change: dict[str, float], message: str) -> None:
    with pytest.raises(PositioningError, match=message) as refusal:
        begin_task(TaskState(), CELL, planner(), **{**GOOD, **change})
    assert str(refusal.value).startswith("press 3: ")


def test_refuses_a_tolerance_below_the_encoder() -> None:
    with pytest.raises(PositioningError, match="finer than the encoder"):
        begin_task(TaskState(), replace(CELL, resolution_m=100e-6), planner(), **GOOD)


def test_refuses_a_second_task() -> None:
    sequence, made = waiting()
    with pytest.raises(PositioningError, match="is running"):
        begin_task(sequence, CELL, made, **GOOD)


def test_in_place_already() -> None:
    sequence = begin_task(TaskState(), CELL, planner(), **{**GOOD, "target_m": 2.02e-3})
    assert sequence.phase is TaskPhase.SETTLED
    assert sequence.taps == 0


def test_two_sided_goes_back() -> None:
    made = TapPlanner(tolerance_m=50e-6, two_sided=True)
    cell = replace(CELL, two_sided=True)
    sequence = begin_task(TaskState(), cell, made, **{**GOOD, "target_m": 10e-3, "position_m": 20e-3})
    assert sequence.tap is not None
    assert sequence.tap.direction == -1


def test_a_tap_that_moved_nothing_stops_with_an_alarm() -> None:
    sequence, made = waiting()
    stopped = observed(sequence, CELL, made, sequence.position_m)
    assert stopped.phase is TaskPhase.FAULTED
    assert "moved nothing" in stopped.reason
    assert stopped.evidence is not None
    assert stopped.tap is None


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_displacement_outside_its_band_stops_with_evidence(side: float) -> None:
    sequence, made = waiting()
    tap = sequence.tap
    assert tap is not None
    moved = tap.highest_m * 1.05 if side > 0.0 else tap.lowest_m * 0.95
    stopped = observed(sequence, CELL, made, sequence.position_m + moved)
    assert stopped.phase is TaskPhase.FAULTED
    assert "outside the 99.9 % band" in stopped.reason
    assert stopped.evidence is not None
    assert stopped.evidence.threshold == pytest.approx(3.29)
    assert stopped.evidence.size == pytest.approx(moved - tap.expected_m)
    inside = observed(sequence, CELL, made, sequence.position_m + 0.999 * tap.expected_m)
    assert inside.phase in {TaskPhase.COMMANDING, TaskPhase.SETTLED}


@pytest.mark.parametrize(("position_m", "told"), [(5.0, "outside the 99.9 % band"), (-0.5, "moved nothing")])
def test_a_part_that_was_carried_off_teaches_nothing_and_stops_the_task(position_m: float, told: str) -> None:
    sequence, made = waiting()
    before = made.posterior
    stopped = observed(sequence, CELL, made, position_m)
    assert stopped.phase is TaskPhase.FAULTED
    assert told in stopped.reason
    assert made.posterior is before


def test_a_part_on_its_target_is_in_place_however_it_got_there_and_the_miss_is_told() -> None:
    """Before, "the part is not in place" was said of one that lay on its target."""
    sequence, made = waiting()
    tap = sequence.tap
    assert tap is not None
    watched = made.posterior.watch.evidence
    short = replace(tap, expected_m=4e-3, lowest_m=3e-3, highest_m=5e-3)
    arrived = observed(replace(sequence, tap=short), CELL, made, sequence.target_m)
    assert arrived.phase is TaskPhase.SETTLED
    assert arrived.outcome.settled
    assert arrived.reason == (
        "in place; tap 1 moved the part by 18.0000 mm, outside the 99.9 % band of 3.0000 to 5.0000 mm"
    )
    assert made.posterior.taps == 1
    assert made.posterior.watch.evidence != watched


def test_in_place_with_the_last_tap_there_may_be() -> None:
    sequence, made = waiting()
    arrived = observed(replace(sequence, taps=MOST_TAPS), CELL, made, sequence.target_m)
    assert arrived.phase is TaskPhase.SETTLED
    assert sequence.tap is not None
    on_its_way = sequence.position_m + sequence.tap.expected_m
    stopped = observed(replace(sequence, taps=MOST_TAPS), CELL, made, on_its_way)
    assert stopped.reason == "press 3: not in place after 200 taps"


@pytest.mark.parametrize("half_m", [0.0, 1e-12])
def test_a_miss_beyond_all_measure_has_a_statistic_that_json_can_write(half_m: float) -> None:
    sequence, made = waiting()
    tap = sequence.tap
    assert tap is not None
    sure = replace(tap, lowest_m=tap.expected_m - half_m, highest_m=tap.expected_m + half_m)
    far = sequence.position_m + tap.expected_m + 1e-3
    stopped = observed(replace(sequence, tap=sure), CELL, made, far)
    assert stopped.evidence is not None
    assert stopped.evidence.statistic == LARGEST_STATISTIC > stopped.evidence.threshold


def test_a_lost_link_and_an_abort_at_any_moment() -> None:
    sequence, made = waiting()
    commanding = begin_task(TaskState(), CELL, made, **GOOD)
    for running in (sequence, commanding):
        lost = failed(running, "press 3: link lost")
        assert lost.phase is TaskPhase.FAULTED
        assert lost.reason == "press 3: link lost"
        stopped = aborted(running, "operator")
        assert stopped.phase is TaskPhase.IDLE
        assert stopped.tap is None
        assert begin_task(stopped, CELL, made, **GOOD).phase is TaskPhase.COMMANDING
        assert begin_task(lost, CELL, made, **GOOD).phase is TaskPhase.COMMANDING
    assert observed(aborted(sequence, "PLC"), CELL, made, 9e-3).phase is TaskPhase.IDLE  # a late answer


def test_a_tap_before_which_the_part_has_moved_is_planned_anew_and_not_counted() -> None:
    sequence, made = waiting()
    again = replan(sequence, CELL, made, 5e-3)
    assert (again.phase, again.taps, again.position_m) == (TaskPhase.COMMANDING, 0, 5e-3)
    assert again.tap != sequence.tap
    assert (again.start_m, made.posterior.taps) == (sequence.start_m, 0)
    there = replan(commanded(again), CELL, made, GOOD["target_m"])
    assert (there.phase, there.reason, there.outcome.taps) == (TaskPhase.SETTLED, "in place", 0)


def test_a_part_that_moves_before_each_tap_stops_with_an_alarm_unless_one_is_made() -> None:
    sequence, made = waiting()
    for number in range(MOST_REPLANS):
        again = replan(sequence, CELL, made, 2e-3 + 1e-4 * number)
        assert again.phase is TaskPhase.COMMANDING
        sequence = commanded(again)
    last = replan(sequence, CELL, made, 8e-3)
    assert last.phase is TaskPhase.FAULTED
    assert last.reason == f"press 3: the part has moved {MOST_REPLANS + 1} times before tap 1 was made"
    assert sequence.tap is not None
    struck = observed(sequence, CELL, made, sequence.position_m + sequence.tap.expected_m)
    assert replan(commanded(struck), CELL, made, 8e-3).phase is TaskPhase.COMMANDING


def test_no_position_is_a_fault() -> None:
    sequence, made = waiting()
    stopped = observed(sequence, CELL, made, math.nan)
    assert stopped.phase is TaskPhase.FAULTED
    assert math.isnan(stopped.remaining_m)


def test_a_fault_leaves_no_position_of_before_a_tap_that_may_have_moved_the_part() -> None:
    sequence, made = waiting()
    assert math.isnan(failed(sequence, "press 3: link lost").remaining_m)
    commanding = begin_task(TaskState(), CELL, made, **GOOD)
    assert failed(commanding, "press 3: refused").remaining_m == GOOD["target_m"] - GOOD["position_m"]
    lies_at = sequence.position_m + 1e-6
    assert observed(sequence, CELL, made, lies_at).remaining_m == sequence.target_m - lies_at


@pytest.mark.parametrize(
    ("tap", "force", "message"),
    [
        (Tap(0.11, 1e-3), 10.0, "0.11 m/s is not allowed"),
        (Tap(0.05, 1.6e-3), 10.0, "stroke of 1.6 mm"),
        (Tap(0.05, math.nan), 10.0, "stroke"),
        (Tap(math.nan, 1e-3), 10.0, "not allowed"),
        (Tap(0.05, 1e-3, direction=0), 10.0, "direction"),
        (Tap(0.05, 1e-3, highest_m=20e-3), 300.0, "300 N"),
        (Tap(0.05, 1e-3, highest_m=20e-3), math.nan, "not allowed"),
        (Tap(0.05, 1e-3, highest_m=41e-3), 10.0, "61.000 mm"),
        (Tap(0.05, 1e-3, direction=-1, highest_m=21e-3), 10.0, "-1.000 mm"),
    ],
)
def test_limits_are_the_last_gate(tap: Tap, force: float, message: str) -> None:
    with pytest.raises(PositioningError, match=message):
        check_tap(tap, replace(LIMITS, force_n=200.0), 20e-3, force, "press 3")


EVENTS = st.lists(
    st.one_of(
        st.sampled_from(["begin", "commanded", "failed", "aborted", "nothing", "nan"]),
        st.floats(0.0, 3.0),
    ),
    max_size=12,
)


@settings(max_examples=60, deadline=None)
@given(EVENTS)
def test_any_course_of_events_keeps_the_invariants(events: list[str | float]) -> None:
    made, sequence = planner(), TaskState()
    for event in events:
        before = sequence
        if event == "begin":
            try:
                sequence = begin_task(sequence, CELL, made, **GOOD)
            except PositioningError:
                assert sequence == before
        elif event == "commanded":
            sequence = commanded(sequence)
        elif event == "failed":
            sequence = failed(sequence, "gone")
        elif event == "aborted":
            sequence = aborted(sequence, "operator")
        else:
            share = {"nothing": 0.0, "nan": math.nan}.get(event, event) if isinstance(event, str) else event
            reach = sequence.tap.expected_m if sequence.tap else 0.0
            sequence = observed(sequence, CELL, made, sequence.position_m + share * reach)
        assert sequence.running == (sequence.tap is not None)
        assert sequence.running or sequence.phase is TaskPhase.IDLE or sequence.reason
        if sequence.tap is not None:
            assert sequence.tap.velocity_m_s <= LIMITS.velocity_m_s
            assert sequence.tap.stroke_m <= LIMITS.stroke_m
        if sequence.phase is TaskPhase.WAITING and before.phase is not TaskPhase.WAITING:
            assert event == "commanded"
