"""Taps that no model has: a part that never moves, one that somebody moves, a sensor that scatters."""

import math

import numpy as np
import pytest

from impactcell.errors import PositioningError
from impactcell.positioning import Tap, TapPlanner, Unreachable
from impactcell.positioning.mixture_components import (
    MOST_COMPONENTS,
    split_components,
    within_most_components,
)
from impactcell.positioning.model_hypotheses import PROBABILITIES
from impactcell.positioning.planner_posterior import prior_of_plant
from impactcell.positioning.without_tap import MOST_STILL
from simulator.plant_nominal import nominal_taps

MU_S, RATIO = 0.2, 0.76


def displacement_m(tap: Tap, mass_kg: float, rng: np.random.Generator) -> float:
    """Displacement by the plant that the planner starts from, friction scattering by 3 %."""
    mu_s = MU_S * (1.0 + 0.03 * rng.standard_normal())
    nominal = nominal_taps(
        6.5e5, 465.0, mu_s, RATIO * mu_s, mass_kg, tap.velocity_m_s, tap.stroke_m
    ).displacement_m  # fmt: skip
    return float(nominal[0])


def new_planner(tolerance_m: float = 50e-6, noise_m: float = 0.5e-6) -> TapPlanner:
    return TapPlanner(tolerance_m=tolerance_m, plant={"mu_s": MU_S}, position_noise_m=noise_m)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("remaining_m", "mass_kg"), [(4e-3, 18.9), (0.2e-3, 18.9), (30e-3, 8.0), (0.1e-3, 30.0)]
)
def test_a_part_that_never_moves_is_given_up_and_not_held_to_slide_more_easily(
    remaining_m: float, mass_kg: float
) -> None:
    planner = new_planner()
    before = planner.posterior.mu_k
    for _ in range(2):
        for _ in range(MOST_STILL):
            tap = planner.next_tap(remaining_m, mass_kg)
            assert isinstance(tap, Tap)
            planner.observe(tap, 0.0, mass_kg)
            assert planner.posterior.mu_k >= before - 1e-9
            assert planner.posterior.weights.size <= MOST_COMPONENTS * PROBABILITIES.size
        assert isinstance(planner.next_tap(remaining_m, mass_kg), Unreachable)


def test_what_cannot_have_been_teaches_nothing_and_friction_may_have_changed() -> None:
    planner = new_planner()
    before = planner.posterior
    tap = Tap(0.024, 1.5e-3, expected_m=2e-3)  # pushed by 1.5 mm, a part that only friction of 5 would hold
    for _ in range(3):
        planner.observe(tap, 0.0, 18.9)
    after = planner.posterior
    np.testing.assert_allclose(after.mean, before.mean, atol=1e-9)
    np.testing.assert_allclose(after.probabilities, before.probabilities)
    assert after.taps == 3
    assert after.weights.size <= 2 * before.weights.size
    assert after.cov[0, 0] > before.cov[0, 0] + 0.005


def test_components_beyond_what_is_affordable_join_their_neighbours() -> None:
    many = split_components(prior_of_plant(6.5e5, 465.0, 0.2, 0.152, 0.0))
    while many.weights.size <= MOST_COMPONENTS:
        covs = many.covs.copy()
        covs[:, 0, 0] += 0.1**2
        many = split_components(type(many)(many.weights, many.means, covs, hypotheses=many.hypotheses))
    few = within_most_components(many)
    assert few.weights.size == MOST_COMPONENTS
    np.testing.assert_allclose(few.weights.sum(), many.weights.sum())
    np.testing.assert_allclose(few.mean, many.mean, atol=1e-12)
    np.testing.assert_allclose(few.cov, many.cov, atol=1e-12)
    assert few.weights.min() >= np.sort(many.weights)[-MOST_COMPONENTS]
    assert within_most_components(few) is few


@pytest.mark.slow
@pytest.mark.parametrize("odd", ["stuck", "three times as far"])
def test_a_part_that_was_moved_once_is_no_sign_of_a_model_that_lacks_something(odd: str) -> None:
    rng, planner, told, doubted = np.random.default_rng(0), new_planner(), [], False
    for task in range(14):
        remaining, mass_kg = rng.uniform(5e-3, 30e-3), rng.uniform(8.0, 30.0)
        is_odd = task == 8
        while isinstance(tap := planner.next_tap(remaining, mass_kg), Tap):
            moved = displacement_m(tap, mass_kg, rng)
            if is_odd:
                moved = 0.0 if odd == "stuck" else 3.0 * moved
            planner.observe(tap, moved, mass_kg)
            doubted |= is_odd and planner.posterior.watch.doubted
            is_odd, remaining = False, remaining - moved
            told.append(planner.predictions.lacking)
    assert doubted
    assert not any(told)


@pytest.mark.slow
def test_a_sensor_that_scatters_is_reckoned_with() -> None:
    """4 µm of a reading, 5.7 of a displacement: two of these off, a push that is foretold well is none."""
    off_m = 2.0 * math.sqrt(2.0) * 4e-6
    exact, scattering = new_planner(), new_planner(noise_m=math.sqrt(2.0) * 4e-6)
    push, rng = Tap(0.005, 0.2e-3), np.random.default_rng(3)
    for planner in (exact, scattering):
        for _ in range(12):
            planner.observe(push, displacement_m(push, 10.0, rng), 10.0)
        planner.observe(push, displacement_m(push, 10.0, rng) + off_m, 10.0)
    assert exact.posterior.watch.score > 3.0
    assert abs(scattering.posterior.watch.score) < 2.5
    assert exact.posterior.surprise > 3.0
    assert abs(scattering.posterior.surprise) < 2.5


@pytest.mark.parametrize("noise_m", [0.0, -1e-6, math.nan, 4.0, "2e-6", None])
def test_a_noise_that_no_sensor_has_is_refused(noise_m: float) -> None:
    with pytest.raises(PositioningError, match="position_noise_m lies between 0 and"):
        TapPlanner(position_noise_m=noise_m)


def test_the_noise_of_the_default_changes_nothing() -> None:
    told, default = new_planner(), TapPlanner(tolerance_m=50e-6, plant={"mu_s": MU_S})
    tap = told.next_tap(12e-3, 15.0)
    assert isinstance(tap, Tap)
    assert tap == default.next_tap(12e-3, 15.0)
    for planner in (told, default):
        planner.observe(tap, 9e-3, 15.0)
    np.testing.assert_array_equal(told.posterior.means, default.posterior.means)
