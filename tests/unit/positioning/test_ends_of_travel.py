"""Targets at the ends of the travel: parts settle there from inside, and no tap may bring one beyond."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.errors import PositioningError
from impactcell.physics import Plant
from impactcell.positioning import SafetyLimits, Tap, TapPlanner, Unreachable
from impactcell.positioning.safety_limits import check_tap, room_m
from impactcell.positioning.task_state_machine import (
    PositioningCell,
    TaskPhase,
    TaskState,
    begin_task,
    commanded,
    observed,
)
from simulator.plant_nominal import nominal_taps

NOMINAL = Plant(stiffness_n_per_m=6.5e5, damping_n_s_per_m=465.0, mu_s=0.2, mu_k=0.152)
TRAVEL_M = (0.0, 40e-3)
CELL = PositioningCell("c", SafetyLimits(0.1, 1.5e-3, travel_m=TRAVEL_M), 1e-6, two_sided=True)


def planner(tolerance_m: float = 50e-6) -> TapPlanner:
    return TapPlanner(tolerance_m=tolerance_m, plant=NOMINAL, two_sided=True, travel_m=TRAVEL_M)


def play(
    made: TapPlanner, plant: Plant, target_m: float, start_m: float, mass_kg: float, rng: np.random.Generator
) -> tuple[TaskState, list[float]]:
    """Bring a part to its target on the simulator's plant; the task, and where the part has lain."""
    task = begin_task(
        TaskState(), CELL, made, target_m=target_m, position_m=start_m, mass_kg=mass_kg, trained=True
    )
    lain = [start_m]
    while task.tap is not None:
        factor = 1.0 + 0.03 * rng.standard_normal()
        moved = nominal_taps(
            plant.stiffness_n_per_m, plant.damping_n_s_per_m, plant.mu_s * factor, plant.mu_k * factor,
            mass_kg, task.tap.velocity_m_s, task.tap.stroke_m,
        ).displacement_m[0]  # fmt: skip
        lain.append(lain[-1] + task.tap.direction * float(moved))
        task = observed(commanded(task), CELL, made, lain[-1])
    return task, lain


@pytest.mark.slow
@pytest.mark.parametrize("inside_m", [0.0, 20e-6, 200e-6])
def test_parts_settle_at_both_ends_and_none_passes_them(inside_m: float) -> None:
    """Before, 0 of 25 settled at an end itself: the tap was refused, and no gentler one was tried."""
    made, rng = planner(), np.random.default_rng(4)
    plant, taps = Plant(7e5, 430.0, 0.22, 0.76 * 0.22), []
    for number in range(12):
        target_m = inside_m if number % 2 else TRAVEL_M[1] - inside_m
        task, lain = play(
            made, plant, target_m, float(rng.uniform(5e-3, 35e-3)), float(rng.uniform(6.0, 30.0)), rng
        )
        assert task.phase is TaskPhase.SETTLED, task.reason
        assert abs(lain[-1] - target_m) <= made.tolerance_m
        assert TRAVEL_M[0] <= min(lain)
        assert max(lain) <= TRAVEL_M[1]
        taps.append(task.taps)
    assert np.mean(taps) < 4.5


@pytest.mark.slow
def test_the_first_task_of_a_cell_may_lead_to_an_end() -> None:
    made = planner()
    task, lain = play(made, NOMINAL, 40e-3, 39e-3, 15.0, np.random.default_rng(1))
    assert task.phase is TaskPhase.SETTLED, task.reason
    assert max(lain) <= TRAVEL_M[1]


@cache
def taught(tolerance_m: float) -> TapPlanner:
    """A planner that has learned of a few tasks."""
    made, rng = planner(tolerance_m), np.random.default_rng(3)
    for target_m in (20e-3, 12e-3, 27e-3):
        play(made, NOMINAL, target_m, 5e-3, 12.0, rng)
    return made


MICROMETRES = st.floats(0.0, 40e3)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    tolerance_m=st.sampled_from([10e-6, 50e-6]),
    at_an_end=st.booleans(),
    target_um=st.one_of(st.floats(0.0, 200.0), MICROMETRES),
    start_um=st.one_of(st.floats(0.0, 500.0), MICROMETRES),
    mass_kg=st.floats(4.0, 40.0),
)
def test_every_tap_that_is_planned_stays_within_the_travel(
    tolerance_m: float, at_an_end: bool, target_um: float, start_um: float, mass_kg: float
) -> None:
    """What the planner chooses is what the last gate allows, wherever part and target lie."""
    high = TRAVEL_M[1]
    target_m, start_m = (
        max(high - 1e-6 * um if at_an_end else 1e-6 * um, 0.0) for um in (target_um, start_um)
    )
    made = taught(tolerance_m)
    asked = {"target_m": target_m, "position_m": start_m, "mass_kg": mass_kg, "trained": True}
    if isinstance(made.next_tap(target_m - start_m, mass_kg, start_m), Unreachable):
        with pytest.raises(PositioningError, match=r"^c: [^:]* µm remain"):
            begin_task(TaskState(), CELL, made, **asked)
        return
    task = begin_task(TaskState(), CELL, made, **asked)
    made.travel_m = (-math.inf, math.inf)
    usual = made.next_tap(target_m - start_m, mass_kg, start_m)
    made.travel_m = TRAVEL_M
    if task.tap is None:
        assert usual is None
        return
    assert task.tap.highest_m <= room_m(TRAVEL_M, start_m, task.tap.direction)
    assert task.tap.overshoot_probability <= 1e-3
    assert isinstance(usual, Tap)
    if usual.highest_m <= room_m(TRAVEL_M, start_m, usual.direction):
        assert task.tap == usual


def test_a_target_that_no_tap_reaches_from_inside_is_refused_with_a_way_out() -> None:
    """A cell without a stroke cannot strike as gently as the end of the travel asks."""
    made = TapPlanner(
        tolerance_m=200e-6, plant=NOMINAL, max_stroke_m=math.inf, two_sided=True, travel_m=TRAVEL_M
    )
    made.observe_friction(0.152, 0.002)
    assert isinstance(made.next_tap(-0.4e-3, 30.0, 20e-3), Tap)
    answer = made.next_tap(-0.4e-3, 30.0, TRAVEL_M[0] + 0.4e-3)
    assert isinstance(answer, Unreachable)
    assert "or may pass the end of the travel, 0.400 mm away; set a target further from it" in answer.reason


def test_a_target_beyond_the_travel_is_out_of_reach() -> None:
    answer = planner().next_tap(5e-3, 12.0, 38e-3)
    assert answer == Unreachable("the target lies 3.000 mm beyond the travel")


def test_a_tap_that_leads_back_into_the_travel_is_allowed() -> None:
    """A part that lies beyond an end could not be brought back by taps that end there as well."""
    tap = Tap(0.05, 1e-3, direction=-1, highest_m=0.2e-3)
    assert check_tap(tap, CELL.limits, 40.5e-3, 10.0) is tap
    with pytest.raises(PositioningError, match=r"may bring the part to 40.700 mm .* 0 to 40 mm"):
        check_tap(replace(tap, direction=1), CELL.limits, 40.5e-3, 10.0)


def test_refuses_a_travel_whose_ends_are_not_in_order() -> None:
    with pytest.raises(PositioningError, match="travel_m must be in order"):
        TapPlanner(travel_m=(40e-3, 0.0))
