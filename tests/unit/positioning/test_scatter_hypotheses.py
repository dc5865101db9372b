"""The scatter is learned, of friction, displacement and contact apart, and its tails are those of the sum."""

import numpy as np
import pytest
from scipy.stats import norm

from impactcell.positioning.scatter_hypotheses import (
    FRICTION_STD,
    GRID,
    PRIOR_WEIGHTS,
    mean_variances,
    quantile_scales,
    tail_scores,
    update_weights,
)


def learned(friction: float, displacement: float, taps: int, seed: int) -> np.ndarray:
    """Weights after taps that are strikes and pushes in turn."""
    rng = np.random.default_rng(seed)
    weights = PRIOR_WEIGHTS
    for n in range(taps):
        moved, by_friction = (5e-3, 5e-3) if n % 2 == 0 else (200e-6, 40e-6)
        deviation = (
            by_friction * friction * rng.standard_normal() + moved * displacement * rng.standard_normal()
        )
        reaches = np.array([[by_friction, moved, 40e-6]])
        weights, _ = update_weights(
            weights, np.ones(1), np.array([deviation]), np.array([(0.5e-6) ** 2]), reaches
        )
    return weights


@pytest.mark.parametrize("friction", [0.005, 0.03, 0.08])
def test_scatter_of_friction_is_learned(friction: float) -> None:
    std = np.sqrt(mean_variances(learned(friction, 0.0, 60, 1)))
    assert std[0] == pytest.approx(friction, rel=0.4)
    assert std[1] < 0.005


@pytest.mark.parametrize("displacement", [0.03, 0.08])
def test_scatter_of_the_displacement_is_told_apart(displacement: float) -> None:
    std = np.sqrt(mean_variances(learned(0.005, displacement, 60, 2)))
    assert std[1] == pytest.approx(displacement, rel=0.4)


def test_an_outlier_is_not_scatter() -> None:
    calm = learned(0.02, 0.0, 60, 3)
    reaches = np.array([[5e-3, 5e-3, 40e-6]])
    after, _ = update_weights(calm, np.ones(1), np.array([8 * 0.02 * 5e-3]), np.array([1e-12]), reaches)
    assert mean_variances(after)[0] < 2.0 * mean_variances(calm)[0]


def test_tails_are_those_of_the_sum_of_normals() -> None:
    z = np.array([-3.3, -1.2, 1.2, 3.3])
    scales = quantile_scales(tail_scores(PRIOR_WEIGHTS), z)
    share = np.array([PRIOR_WEIGHTS[GRID[:, 0] == std].sum() for std in FRICTION_STD])
    reached = np.abs(z) * scales[:, 0]
    tail = (share[:, None] * norm.sf(reached / FRICTION_STD[:, None])).sum(axis=0)
    np.testing.assert_allclose(tail, norm.sf(np.abs(z)), rtol=0.02)
    assert scales[3, 0] > 1.2 * scales[2, 0]  # heavier than one normal distribution


def test_what_no_hypothesis_explains_teaches_nothing() -> None:
    after, density = update_weights(
        PRIOR_WEIGHTS, np.ones(1), np.array([1e9]), np.array([1e-12]), np.ones((1, 3)) * 1e-9
    )
    np.testing.assert_array_equal(after, PRIOR_WEIGHTS)
    assert density < -600.0


def test_the_density_of_a_tap_integrates_to_one() -> None:
    moved = np.linspace(-6e-3, 6e-3, 6001)
    reaches = np.array([[5e-3, 5e-3, 40e-6]])
    density = [
        update_weights(PRIOR_WEIGHTS, np.ones(1), np.array([d]), np.array([(20e-6) ** 2]), reaches)[1]
        for d in moved
    ]
    total = np.trapezoid(np.exp(density), moved) / np.sqrt(2.0 * np.pi)
    assert total == pytest.approx(1.0, abs=2e-3)
