"""Belief and learning: moments kept, truth found, the tracker believed as far as it should be."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impactcell.physics.closed_form import displacement_of
from impactcell.positioning.displacement_quantiles import plant_parameters
from impactcell.positioning.mixture_components import (
    merge_components,
    split_components,
)
from impactcell.positioning.model_hypotheses import condition_on_friction, parts_of, prior
from impactcell.positioning.planner_posterior import (
    RATIO,
    STIFFNESS,
    PlannerPosterior,
    anticipate_learning,
    prior_of_plant,
    with_single_gaussian,
)
from impactcell.positioning.posterior_update import update_posterior
from impactcell.positioning.tap import Tap
from impactcell.positioning.tap_model import model_of_tap
from simulator.plant_nominal import nominal_taps

START = prior(6.5e5, 465.0, 0.2, 0.152, 0.0)


def std(belief: PlannerPosterior) -> np.ndarray:
    return np.sqrt(np.diag(belief.cov))


def test_splitting_keeps_mean_and_covariance() -> None:
    start = prior_of_plant(6.5e5, 465.0, 0.2, 0.152, 0.0)
    parts = split_components(start)
    assert parts.weights.size > 5
    np.testing.assert_allclose(parts.weights.sum(), 1.0)
    np.testing.assert_allclose(parts.mean, start.mean, atol=1e-12)
    np.testing.assert_allclose(parts.cov, start.cov, rtol=0.02, atol=1e-6)
    assert all(np.linalg.eigvalsh(cov).min() > -1e-12 for cov in parts.covs)
    narrow = merge_components(
        replace(parts, means=start.mean + 0.05 * (parts.means - start.mean), covs=parts.covs * 0.01)
    )
    assert narrow.weights.size == 1


def taught(noise: float, taps: int, seed: int, sigma: float = 0.03) -> tuple[PlannerPosterior, np.ndarray]:
    """Belief after `taps` random taps on a cell that is a tenth off, and the true parameters."""
    rng = np.random.default_rng(seed)
    k, b = 6.5e5 * (1.0 + 0.1 * rng.choice([-1, 1])), 465.0 * (1.0 + 0.1 * rng.choice([-1, 1]))
    mu_s = rng.uniform(0.13, 0.29)
    belief = START
    for _ in range(taps):
        mass, velocity = math.exp(rng.uniform(math.log(5), math.log(40))), rng.uniform(0.02, 0.1)
        stroke, factor = rng.uniform(2e-4, 1.5e-3), 1.0 + sigma * rng.standard_normal()
        moved = nominal_taps(
            k, b, mu_s * factor, 0.76 * mu_s * factor, mass, velocity, stroke
        ).displacement_m[0]

        def response(
            states: np.ndarray, mass: float = mass, velocity: float = velocity, stroke: float = stroke
        ) -> np.ndarray:
            factors = np.maximum(1.0 + states[:, 5], 0.05)
            return displacement_of(
                velocity,
                np.full(factors.size, stroke),
                plant_parameters(states[:, :5]),
                factors,
                np.array([mass, 9.81]),
            )

        belief = update_posterior(belief, response, float(moved) + noise * rng.standard_normal())
    return belief, np.array([math.log(0.76 * mu_s), math.log(k), math.log(b)])


@pytest.mark.slow
def test_learns_the_cell_and_knows_how_well() -> None:
    errors = []
    for seed in range(4):
        belief, truth = taught(0.0, 25, seed)
        errors.append((belief.mean[:3] - truth) / std(belief)[:3])
        assert abs(belief.mean[0] - truth[0]) < 0.05
        assert std(belief)[0] < 0.02
    errors_ = np.array(errors)
    assert np.abs(errors_).max() < 4.0
    assert np.sqrt((errors_**2).mean()) < 1.5  # not overconfident


@pytest.mark.slow
def test_learns_its_own_scatter() -> None:
    calm, _ = taught(0.0, 60, 1, sigma=0.012)
    rough, _ = taught(0.0, 60, 1, sigma=0.06)
    assert calm.scatter < 0.025
    assert rough.scatter > 0.04


@pytest.mark.parametrize("mass", [8.0, 11.0, 16.0, 23.0, 32.0])
def test_a_push_teaches_where_static_friction_may_be_as_low_as_kinetic(mass: float) -> None:
    """Of a contact stiffer than was thought, by pushes of several speeds; some taught nothing whatever."""
    start = prior_of_plant(7.8e5, 655.0, 0.194, 0.1605, 0.0)
    stds = np.full(start.mean.size, 0.01)
    stds[RATIO], stds[STIFFNESS] = 0.1, 0.03  # of ln(mu_s / mu_k), which is 0.19: two of them are more
    start, part = with_single_gaussian(start, start.mean, np.diag(stds**2)), np.array([mass, 9.81])
    for velocity in np.geomspace(5e-3, 0.01, 8):
        tap = Tap(float(velocity), 4.3e-4)
        moved = nominal_taps(8.03e5, 655.0, 0.194, 0.1605, mass, velocity, 4.3e-4).displacement_m[0]
        after = update_posterior(start, model_of_tap(tap, start, part), float(moved))
        assert not np.array_equal(after.mean, start.mean)


@pytest.mark.slow
def test_an_outlier_teaches_little() -> None:
    belief, _ = taught(0.0, 15, 3)

    def response(states: np.ndarray) -> np.ndarray:
        factors = np.maximum(1.0 + states[:, 5], 0.05)
        strokes, part = np.full(factors.size, 1.2e-3), np.array([15.0, 9.81])
        return displacement_of(0.08, strokes, plant_parameters(states[:, :5]), factors, part)

    expected = float(response(np.append(belief.mean, 0.0)[None])[0])
    after = update_posterior(belief, response, 2.5 * expected)
    assert abs(after.mean[0] - belief.mean[0]) < 0.03
    assert after.surprise > 8.0
    again = update_posterior(after, response, 2.5 * expected)
    assert std(again)[0] > 3.0 * std(belief)[0]  # twice the same: friction has changed


def test_what_cannot_be_modelled_teaches_nothing() -> None:
    after = update_posterior(START, lambda states: np.full(len(states), math.nan), 1e-3)
    np.testing.assert_allclose(after.mean, START.mean, atol=1e-12)
    np.testing.assert_allclose(after.cov, START.cov, rtol=0.02, atol=1e-6)
    np.testing.assert_allclose(after.probabilities, START.probabilities)
    assert after.taps == 1


def test_the_tracker_informs_a_new_cell() -> None:
    told = condition_on_friction(START, 0.2, 0.004, batch_changed=False)
    assert told.mu_k == pytest.approx(0.2, rel=1e-9)
    assert std(told)[0] == pytest.approx(math.hypot(0.02, 0.007))
    np.testing.assert_allclose(std(told)[1:], std(START)[1:])


def test_a_vague_tracker_changes_nothing() -> None:
    sure = condition_on_friction(START, 0.2, 0.001, batch_changed=False)
    assert condition_on_friction(sure, 0.203, 0.02, batch_changed=False) is sure


def test_a_tracker_that_contradicts_prevails_but_is_doubted() -> None:
    sure = condition_on_friction(START, 0.2, 0.001, batch_changed=False)
    moved = condition_on_friction(sure, 0.25, 0.001, batch_changed=False)
    assert moved.mu_k == pytest.approx(0.25, rel=1e-9)
    assert std(moved)[0] > 0.05


@pytest.mark.slow
def test_a_batch_change_frees_friction_and_nothing_else() -> None:
    belief, _ = taught(0.0, 20, 4)
    new = condition_on_friction(belief, belief.mu_k, 0.001, batch_changed=True)
    assert std(new)[0] > 0.08
    np.testing.assert_allclose(std(new)[1:], std(belief)[1:])
    assert all((part.cov[0, 1:] == 0.0).all() for part in parts_of(new))


def test_foreseen_never_knows_less() -> None:
    later = anticipate_learning(START)
    assert (std(later) <= std(START) * (1.0 + 1e-12)).all()
    assert std(later)[0] < 0.02
    tight = with_single_gaussian(START, START.mean, np.diag(np.full(START.mean.size, 1e-8)))
    np.testing.assert_allclose(anticipate_learning(tight).cov, tight.cov)
