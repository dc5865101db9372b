"""Blocks whose noise neighbours share, against the covariance of their samples, written down and inverted."""

import math

import numpy as np
import pytest

from impactcell.features.noise_kernel import correlated_noise
from impactcell.prediction.whitening import whitening, within_block_std
from impactcell.records import CorrelatedNoise, SharedPart

STEP_S = 5e-5
NOISES = {
    "first order": CorrelatedNoise(0.1, (SharedPart(0.5, 3e-4),), STEP_S),
    "two of first order": CorrelatedNoise(0.2, (SharedPart(0.5, 1e-4), SharedPart(1.0, 2e-2)), STEP_S),
    "hum": CorrelatedNoise(0.5, (SharedPart(0.7, math.inf, 50.0),), STEP_S),
    "fading hum": CorrelatedNoise(0.5, (SharedPart(0.7, 0.05, 50.0), SharedPart(0.3, 1e-3)), STEP_S),
}


def dense(noise: CorrelatedNoise, sizes: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean times and covariance of the means of so many samples each, and the covariance of the samples."""
    times = STEP_S * np.arange(sum(sizes))
    apart = np.abs(times[:, None] - times[None])
    covariance = noise.white_std**2 * np.eye(len(times))
    for part in noise.parts:
        turning = np.cos(2.0 * math.pi * part.frequency_hz * apart)
        covariance += part.std**2 * np.exp(-apart / part.decay_s) * turning
    means = np.zeros((len(sizes), len(times)))
    first = 0
    for row, size in zip(means, sizes, strict=True):
        row[first : first + size] = 1.0 / size
        first += size
    return means @ times, means @ covariance @ means.T, covariance


@pytest.mark.parametrize("name", NOISES)
@pytest.mark.parametrize("sizes", [[1] * 40, [2] * 40, [2, 2, 1, 1, 1, 2, 3, 5, 1, 2] * 4])
def test_innovations_have_the_likelihood_of_the_covariance(name: str, sizes: list[int]) -> None:
    """The mean of a tone is its value in the middle times a factor: exact to first order in its fading."""
    noise = NOISES[name]
    times, covariance, _ = dense(noise, sizes)
    found = whitening(noise, times, np.array(sizes, dtype=float), np.ones(len(sizes)))
    curves = np.random.default_rng(4).normal(size=(3, len(sizes))) @ np.linalg.cholesky(covariance).T
    scaled = found.innovations(curves) / found.std
    near = 1e-3 if name == "fading hum" else 1e-4
    assert scaled @ scaled.T == pytest.approx(
        curves @ np.linalg.solve(covariance, curves.T), rel=near, abs=near
    )
    assert 2.0 * np.log(found.std).sum() == pytest.approx(np.linalg.slogdet(covariance)[1], abs=near)
    assert found.innovations(curves.ravel()) == pytest.approx(found.innovations(curves).ravel())
    assert found.restored(found.innovations(curves[1])) == pytest.approx(curves[1])


def test_blocks_that_are_left_out_say_nothing_of_the_others() -> None:
    noise = NOISES["hum"]
    times, _, _ = dense(noise, [2] * 30)
    factor = np.where(np.arange(30) == 10, 1e3, 1.0)
    found = whitening(noise, times, np.full(30, 2.0), factor)
    curve = np.zeros(30)
    curve[10] = 50.0
    left = found.innovations(curve) / found.std
    assert np.abs(left).max() < 0.2
    plain = whitening(noise, times, np.full(30, 2.0), np.ones(30))
    assert np.abs(plain.innovations(curve) / plain.std).max() > 50.0


@pytest.mark.parametrize("name", NOISES)
def test_samples_scatter_about_the_mean_of_their_block_as_said(name: str) -> None:
    """The trace of the covariance about the mean, over its degrees of freedom."""
    noise = NOISES[name]
    _, of_mean, samples = dense(noise, [4])
    scatter = (np.trace(samples) / 4.0 - of_mean[0, 0]) * 4.0 / 3.0
    assert within_block_std(noise, 4.0 * STEP_S) == pytest.approx(math.sqrt(scatter))
    assert noise.mean_std(4) == pytest.approx(math.sqrt(of_mean[0, 0]))
    halves = np.array([0.5, 0.5, -0.5, -0.5])
    assert noise.difference_std(4) == pytest.approx(math.sqrt(halves @ samples @ halves))


@pytest.mark.parametrize("seed", [33, 34, 39, 42])
def test_hum_read_from_less_than_two_periods_is_white_once_it_is_foreseen(seed: int) -> None:
    """Its frequency is found off by some hertz: at that for ever it left 1.08 to 1.76 of the noise."""
    rng = np.random.default_rng(seed)

    def hum(count: int) -> np.ndarray:
        tone = 2.0 * np.sin(2.0 * math.pi * (50.0 * STEP_S * np.arange(count) + rng.random()))
        return np.asarray(tone + rng.normal(0.0, 0.5, count))

    noise = correlated_noise([hum(count) for _ in range(12) for count in (300, 600)], STEP_S)
    found = whitening(noise, STEP_S * np.arange(1600), np.ones(1600), np.ones(1600))
    left = found.innovations(np.array([hum(1600) for _ in range(12)])) / found.std
    assert math.sqrt(float(np.mean(left**2))) == pytest.approx(1.0, abs=0.05)
