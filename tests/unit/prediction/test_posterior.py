"""Mixtures of cut-off Gaussians against Monte Carlo, and blocks against what they are made of."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impactcell.features.channels import CheckedChannel
from impactcell.prediction.block_averaging import average_blocks
from impactcell.prediction.phase_reweighting import std_factors
from impactcell.prediction.posterior import TruncatedGaussian, mixture
from tests.posterior_intervals import interval

FORM, OFFSET = np.array([1.0, -1.0]), 0.3
ABOVE = TruncatedGaussian(
    np.array([0.2, 0.4]), np.array([[1.0, 0.3], [0.3, 0.5]]), 0.0, float(np.log(0.41)), 1
)
BELOW = TruncatedGaussian(
    np.array([-0.5, 0.1]), np.array([[0.6, -0.2], [-0.2, 0.4]]), 0.2, float(np.log(0.2)), -1
)


@pytest.mark.parametrize("of", [np.array([0.7, 0.9]), np.array([1.0, 0.0]), np.array([1.0, -1.0])])
def test_moments_and_intervals_are_those_of_samples(of: np.ndarray) -> None:
    rng = np.random.default_rng(1)
    kept, masses = [], []
    for side in (ABOVE, BELOW):
        drawn = rng.multivariate_normal(side.mean, side.covariance, 400_000)
        inside = side.sign * (drawn @ FORM + OFFSET) > 0.0
        kept.append(drawn[inside] @ of)
        masses.append(np.exp(-side.cost) * np.sqrt(np.linalg.det(side.covariance)) * inside.mean())
    weights = np.array(masses) / np.sum(masses)
    posterior = mixture((ABOVE, BELOW), FORM, OFFSET)
    assert posterior.weights == pytest.approx(weights, abs=3e-3)
    samples = np.concatenate(
        [one[: int(150_000 * weight)] for one, weight in zip(kept, weights, strict=True)]
    )
    mean, std = posterior.moments(of)
    assert mean == pytest.approx(samples.mean(), abs=0.01)
    assert std == pytest.approx(samples.std(), rel=0.01)
    assert interval(posterior, of) == pytest.approx(np.quantile(samples, [0.025, 0.975]).tolist(), abs=0.05)


def test_a_side_far_beyond_its_end_is_squeezed_against_it() -> None:
    far = TruncatedGaussian(np.array([-30.0, 0.0]), np.eye(2), 0.0, 0.0, 1)
    mean, std = mixture((far,), FORM, 0.0).moments(FORM)
    assert 0.0 < mean < 0.1
    assert 0.0 < std < 0.1


def test_one_whole_gaussian_is_itself() -> None:
    whole = TruncatedGaussian(ABOVE.mean, ABOVE.covariance, 0.0, ABOVE.log_volume, 0)
    of = np.array([1.0, 1.0])
    mean, std = mixture((whole,), FORM, OFFSET).moments(of)
    assert (mean, std) == pytest.approx((0.6, np.sqrt(2.1)))
    assert interval(mixture((whole,), FORM, OFFSET), of) == pytest.approx(
        (0.6 - 1.96 * std, 0.6 + 1.96 * std), abs=0.01
    )


@given(
    count=st.integers(1, 400),
    rate=st.sampled_from([1e4, 1e5, 1e6]),
    fine=st.lists(st.tuples(st.floats(-0.01, 0.05), st.floats(0.0, 0.003)), max_size=4),
    edge=st.floats(0.0, 0.05),
)
def test_blocks_hold_every_sample_once(
    count: int, rate: float, fine: list[tuple[float, float]], edge: float
) -> None:
    rng = np.random.default_rng(count)
    times = np.cumsum(rng.uniform(0.2, 1.8, count)) / rate
    channel = CheckedChannel(times, rng.normal(size=count), 1.0, sigma=1.0)
    made = average_blocks(channel, 1e-4, 1e-5, [(a, a + width) for a, width in fine], [edge])
    sizes = np.round(made.std**-2.0).astype(int)
    assert sizes.sum() == count
    assert sizes @ made.values == pytest.approx(channel.values.sum(), abs=1e-9)
    assert sizes @ made.time_s == pytest.approx(times.sum(), rel=1e-12)
    bounds = np.concatenate([[0], np.cumsum(sizes)])
    for first, last in pairwise(bounds):
        assert times[last - 1] - times[first] <= 1e-4 + 1e-12
        assert (times[first] >= edge) == (times[last - 1] >= edge)


def test_doubt_leaves_noise_alone_and_widens_what_is_missed() -> None:
    rng = np.random.default_rng(2)
    phase = np.repeat(np.arange(4), 50)
    residual = rng.normal(size=200)
    assert (std_factors(residual, phase) == 1.0).all()
    residual[50:100] += 3.0
    factor = std_factors(residual, phase)
    assert (factor[50:100] > 15.0).all()
    assert (np.delete(factor, slice(50, 100)) == 1.0).all()


def test_what_other_taps_share_is_what_a_wrong_prior_does_to_the_estimate() -> None:
    """Least squares solved by numpy for many draws of the prior's error: noise apart, what they spread by."""
    rng, of = np.random.default_rng(3), np.array([1.0, -0.5, 0.0])
    slopes, precision = rng.normal(size=(12, 3)), np.array([0.0, 4.0, 2.0])
    covariance = np.linalg.inv(slopes.T @ slopes + np.diag(precision**2))
    posterior = mixture((TruncatedGaussian(np.zeros(3), covariance, 0.0, 0.0, 0),), np.zeros(3), 0.0)
    rows = np.vstack([slopes, np.diag(precision)[1:]])
    for shared, drawn in ((precision, [1.0, 1.0]), (np.array([0.0, 4.0, 0.0]), [1.0, 0.0])):
        found = [
            np.linalg.lstsq(rows, np.concatenate([np.zeros(12), error * drawn]), rcond=None)[0] @ of
            for error in rng.normal(size=(4000, 2))
        ]
        assert posterior.shared_std(of, shared) == pytest.approx(np.std(found), rel=0.05)
    assert posterior.shared_std(of, precision) < posterior.moments(of)[1]
    assert posterior.shared_std(of, np.zeros(3)) == 0.0
