"""What the model lacks: which share of a tap it acts on."""

import math

import numpy as np
import pytest

from impactcell.positioning.displacement_discrepancy import (
    BREAKAWAY,
    DEPENDS_ON,
    FEATURES,
    breakaway_features,
    discrepancy_features,
    halting_m,
    indentation_features,
    largest_weight,
)

PART = np.array([15.0, 9.81])


def features(stroke: float, displacement: float, position: float = 0.0, direction: float = 1.0) -> np.ndarray:
    out, tap = np.empty(FEATURES), np.array([stroke, 40e-6, 0.15])
    discrepancy_features(tap, displacement, PART, np.array([position, direction]), out)
    return out


def indenting(velocity: float = 0.03, position: float = 0.0, mass: float = 15.0) -> np.ndarray:
    out = np.empty(FEATURES)
    indentation_features(velocity, np.array([mass, 9.81]), np.array([position, 1.0]), out)
    return out


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


def test_position_counts_from_halfway_along_the_slide_and_direction_by_its_sign() -> None:
    there, back = features(1e-3, 20e-3, 5e-3, 1.0), features(1e-3, 20e-3, 5e-3, -1.0)
    assert there[3] / back[3] == pytest.approx(15.0 / -5.0)
    assert there[9] == -back[9]
    assert indenting(position=5e-3)[3] == pytest.approx(0.25)


def test_a_force_that_is_the_same_for_all_masses_weighs_on_light_parts() -> None:
    light, heavy = indenting(position=20e-3, mass=7.5), indenting(position=20e-3, mass=30.0)
    assert light[4] / heavy[4] == pytest.approx(4.0)
    assert light[3] == heavy[3]


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
