"""Moments of what the planner believes: those of the mixture, worked out once, and nobody can change them."""

import numpy as np

from impactcell.positioning import model_hypotheses
from impactcell.positioning.parameter_directions import ACROSS, ACROSS_Z, directions_of
from impactcell.positioning.planner_posterior import FRICTION, PARAMETERS, PlannerPosterior, mean_at

PRIOR = model_hypotheses.prior(6.5e5, 465.0, 0.25, 0.19, 0.0)


def test_moments_are_those_of_draws() -> None:
    rng = np.random.default_rng(1)
    weights, means, stds = np.array([0.3, 0.7]), np.array([[0.0, 1.0], [2.0, -1.0]]), np.array([0.5, 1.5])
    posterior = PlannerPosterior(weights, means, np.array([np.eye(2) * std**2 for std in stds]))
    which = rng.choice(2, 200_000, p=weights)
    draws = means[which] + stds[which, None] * rng.standard_normal((which.size, 2))
    np.testing.assert_allclose(posterior.mean, draws.mean(axis=0), atol=0.02)
    np.testing.assert_allclose(posterior.cov, np.cov(draws.T), atol=0.04)


def test_who_changes_a_mean_changes_his_own() -> None:
    mean, cov, probabilities = PRIOR.mean, PRIOR.cov, PRIOR.probabilities
    expected = mean.copy(), cov.copy(), probabilities.copy()
    mean[FRICTION], cov[FRICTION], probabilities[0] = 7.0, 7.0, 7.0
    mean_at(PRIOR, np.array([20.0]), np.array([0.1]))[FRICTION] = 7.0
    for moment, before in zip((PRIOR.mean, PRIOR.cov, PRIOR.probabilities), expected, strict=True):
        np.testing.assert_array_equal(moment, before)


def test_line_and_directions_across_make_up_the_covariance() -> None:
    known = directions_of(PRIOR, 20.0, 0.01)
    assert directions_of(PRIOR, 20.0, 0.01) is known
    assert directions_of(PRIOR, 21.0, 0.01) is not known
    line = known.cov[FRICTION] / np.sqrt(known.cov[FRICTION, FRICTION] + PRIOR.scatter**2)
    across = np.hstack([known.steps, known.weights_along]) / ACROSS_Z
    assert across.shape[0] == ACROSS
    total = np.outer(line, line)
    total[1:, 1:] += across.T @ across
    total[PARAMETERS:, PARAMETERS:] += known.root @ known.root.T
    np.testing.assert_allclose(total[1:, 1:], known.cov[1:, 1:], atol=1e-9)
