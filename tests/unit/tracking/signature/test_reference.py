"""What a reference says of its mean's error, and keeps of judged cycles, against plain matrix algebra."""

import numpy as np
import pytest

from impactcell.tracking.signature import friction_profile, reference


def symmetric(rng, n, size):
    root = rng.normal(size=(n, 2 * n))
    return size * root @ root.T


@pytest.mark.parametrize("strength", [0.0, 40.0])
def test_the_error_of_the_mean_is_added_to_that_of_a_cycle(strength):
    """G and h of a cycle with covariance G^-1 become those with G^-1 + V, V the covariance of the mean."""
    rng = np.random.default_rng(5)
    n, j = 6, 9
    G, pooled, h = symmetric(rng, n, 30.0), symmetric(rng, j, 10.0), rng.normal(size=n)
    second_differences = np.diff(np.eye(j), 2, axis=0)
    mean = np.linalg.inv(pooled + np.eye(j) + strength * second_differences.T @ second_differences)
    together = np.linalg.inv(np.linalg.inv(G) + mean[:n, :n])
    matrix, vector = reference.with_mean_error(
        G.copy(), h.copy(), pooled[np.tril_indices(j)].copy(), strength
    )
    assert matrix == pytest.approx(together)
    assert vector == pytest.approx(together @ np.linalg.solve(G, h))


@pytest.mark.slow
def test_the_mean_misfit_is_over_the_cycles_that_were_judged():
    grid = np.linspace(0.0, 4e-3, 5)
    state, judged = reference.initial_state(7), [0.5, None, 1.5, 4.0, None]
    slide = friction_profile.SplineInformation(1e4 * np.eye(7), 2e3 * np.ones(7), 4e-3, 7)
    for misfit in judged:
        state = reference.update(state, slide, grid, 10.0, misfit)
    assert state.spe_sum / state.spe_count == pytest.approx(2.0)
    assert state.weight == len(judged)
