"""What the model lacks: which share of a tap it acts on."""

import math

import numpy as np
import pytest

from impactcell.positioning import Tap, TapPlanner
from impactcell.positioning.displacement_band import BAND_Z, displacement_band
from impactcell.positioning.displacement_discrepancy import (
    BREAKAWAY,
    DEPENDS_ON,
    FEATURES,
    POSITION,
    POSITION_BY_MASS,
    SWING_SHARE,
    breakaway_features,
    discrepancy_features,
    friction_features,
    halting_m,
    indentation_features,
    largest_weight,
    position_feature,
    swing_m,
)
from impactcell.positioning.planner_posterior import PARAMETERS, prior_of_plant, with_single_gaussian
from simulator.plant import Plant, TapInput, simulate_tap

PART = np.array([15.0, 9.81])


def features(stroke: float, displacement: float, position: float = 0.0, direction: float = 1.0) -> np.ndarray:
    out, tap = np.empty(FEATURES), np.array([stroke, 40e-6, 0.15])
    discrepancy_features(tap, displacement, PART, np.array([position, direction]), out)
    return out


def indenting(velocity: float = 0.03) -> np.ndarray:
    out = np.empty(FEATURES)
    indentation_features(velocity, PART, np.array([0.0, 1.0]), out)
    return out


def easing(position: float, mass: float = 15.0) -> np.ndarray:
    return friction_features(np.array([mass, 9.81]), np.array([position, 1.0]))


def breakaway(stroke: float, velocity: float = 0.03) -> np.ndarray:
    out = np.zeros(FEATURES)
    breakaway_features(velocity, stroke, 40e-6, out)
    return out


def test_a_push_has_no_slide_and_a_strike_hardly_anything_else() -> None:
    push, strike = features(200e-6, 160e-6), features(1e-3, 20e-3)
    assert push[0] == pytest.approx(0.0, abs=1e-12)
    assert (push[BREAKAWAY:] == 0.0).all()
    assert strike[0] == pytest.approx(1.0 - 0.96e-3 / 20e-3)
    assert indenting()[5] == 1.0  # of the stroke, which a strike that has left its actuator does not follow


def test_only_what_slides_ahead_of_an_actuator_that_then_halts_is_unsure_of_it() -> None:
    assert halting_m(0.9e-3, 1e-3) == 0.0  # pushed all the way
    assert halting_m(20e-3, math.inf) == 0.0  # struck, and never caught again
    assert halting_m(0.0, 1e-3) == 0.0
    assert halting_m(2e-3, 1e-3) == pytest.approx(0.5e-3)
    assert halting_m(20e-3, 1e-3) < 1e-3  # however far it slides


def test_only_what_is_pushed_hangs_on_where_in_its_swing_it_is_let_go() -> None:
    way = SWING_SHARE * 1e-3
    assert swing_m(1e-3 - way, 1e-3, 1e-3 + way, 1e-3, 0.0) == pytest.approx(0.0, abs=1e-12)  # as pushed
    assert swing_m(1e-3 - way, 1e-3, 1e-3 + way + 7e-6, 1e-3, 0.0) == pytest.approx(7e-6)
    assert swing_m(1e-3 - way + 9e-6, 1e-3, 1e-3 + way, 1e-3, 0.0) == pytest.approx(9e-6)
    assert swing_m(5e-3, 5e-3, 5e-3, math.inf, 40e-6) == 0.0  # struck
    assert swing_m(0.0, 0.0, 1e-6, 30e-6, 40e-6) == 0.0


def test_position_counts_from_halfway_along_the_slide_and_direction_by_its_sign() -> None:
    there, back = features(1e-3, 20e-3, 5e-3, 1.0), features(1e-3, 20e-3, 5e-3, -1.0)
    slid = 20e-3 - 0.96e-3
    halfway = 0.96e-3 + 0.5 * slid
    for tap, sign in ((there, 1.0), (back, -1.0)):
        further = position_feature(5e-3 + sign * halfway) - position_feature(5e-3)
        assert tap[POSITION] == pytest.approx(slid / 20e-3 * further)
        assert np.sign(tap[9]) == sign
    assert easing(5e-3)[POSITION] == pytest.approx(0.25, rel=2e-3)


def test_a_force_that_is_the_same_for_all_masses_weighs_on_light_parts() -> None:
    light, heavy = easing(20e-3, mass=7.5), easing(20e-3, mass=30.0)
    assert light[POSITION_BY_MASS] / heavy[POSITION_BY_MASS] == pytest.approx(4.0)
    assert light[POSITION] == heavy[POSITION]


@pytest.mark.parametrize(("velocity", "stroke"), [(0.03, 1.2e-4), (0.05, 4e-4), (0.1, 1.5e-3)])
@pytest.mark.parametrize(("mass", "position"), [(8.0, 0.01), (32.0, 0.02), (8.0, 0.03), (32.0, 0.035)])
def test_friction_that_grows_along_the_way_is_one_weight_for_push_and_slide(
    velocity: float, stroke: float, mass: float, position: float
) -> None:
    """Against the simulator's plant with such a friction: what one weight says of all taps everywhere."""
    gradient, plant = 10.0, {"stiffness_n_per_m": 6.5e5, "damping_n_s_per_m": 465.0}
    hidden = {"position_dependent_friction": {"gradient_per_m": gradient}}
    moved = simulate_tap(
        Plant(**plant, mu_s=0.2, mu_k=0.152, effects=hidden),
        TapInput(velocity, mass, stroke, start_m=position, dwell_s=1.0, shot=1, shots=2, batch=0),
    ).displacement_m
    posterior = prior_of_plant(6.5e5, 465.0, 0.2, 0.152, 0.0)
    mean = posterior.mean
    mean[PARAMETERS + POSITION] = -math.log1p(gradient * 0.03) / position_feature(0.03)
    knowing = with_single_gaussian(posterior, mean, np.diag(np.full(mean.size, 1e-10)))
    part, place = np.array([mass, 9.81]), np.array([position, 1.0])
    band = displacement_band(knowing, velocity, np.array([stroke]), part, place)[0]
    indentation = 0.152 * mass * 9.81 / 6.5e5
    assert abs(band[BAND_Z.size // 2] - moved) < 0.02 * indentation + 0.01 * moved


@pytest.mark.parametrize("position", [0.0, 0.05, -0.3, 1.0, 3.0])
def test_a_cell_may_count_its_positions_from_far_away(position: float) -> None:
    planner = TapPlanner(tolerance_m=50e-6)
    tap = planner.next_tap(position + 0.02 - position, 20.0, position)
    assert isinstance(tap, Tap)
    planner.observe(tap, tap.expected_m, 20.0)
    assert isinstance(planner.next_tap(0.02 - tap.expected_m, 20.0, position + tap.expected_m), Tap)


def test_a_force_is_bounded_for_the_friction_where_the_part_lies() -> None:
    planner = TapPlanner(tolerance_m=50e-6)
    mean = planner.posterior.mean
    mean[PARAMETERS + POSITION] = -0.3
    std = np.full(mean.size, 1e-6)
    planner.resume(with_single_gaussian(planner.posterior, mean, np.diag(std**2)))
    here, there = (planner.force(Tap(0.01, 1e-3, position_m=x), 30.0) for x in (0.0, 0.04))
    assert there > 1.05 * here


def test_breakaway_counts_where_the_stroke_is_about_the_indentation() -> None:
    assert breakaway(40e-6)[BREAKAWAY] > 3.0 * breakaway(100e-6)[BREAKAWAY]
    assert breakaway(40e-6)[BREAKAWAY] > 1e3 * breakaway(1e-3)[BREAKAWAY]
    assert breakaway(40e-6)[BREAKAWAY + 1] == 0.0
    assert breakaway(40e-6, 0.1)[BREAKAWAY + 1] > 0.0 > breakaway(40e-6, 0.005)[BREAKAWAY + 1]
    assert (breakaway(40e-6)[:BREAKAWAY] == 0.0).all()


def test_a_tap_that_moves_nothing_and_one_without_a_stroke() -> None:
    assert (features(1e-3, 0.0) == 0.0).all()
    assert features(math.inf, 5e-3)[0] == 1.0
    assert (breakaway(math.inf) == 0.0).all()


def test_every_weight_says_what_the_displacement_depends_on() -> None:
    assert sorted(n for weights in DEPENDS_ON.values() for n in weights) == list(range(FEATURES))
    mean = np.zeros(FEATURES)
    mean[3] = -0.1
    assert largest_weight(mean, np.eye(FEATURES) * 0.02**2) == ("position", -0.1, 0.02)
