"""What neighbouring samples share of their noise, found in pieces that numpy and scipy made."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from impactcell.features.noise_kernel import correlated_noise
from impactcell.records import Samples

STEP_S = 5e-5


def first_order(rng: np.random.Generator, count: int, decay_s: float) -> Samples:
    """Noise of first order and a variance of 1, by a recursive filter that begins in its own middle."""
    forgotten = math.exp(-STEP_S / decay_s)
    white = math.sqrt(1.0 - forgotten**2) * rng.normal(size=count)
    values, _ = lfilter([1.0], [1.0, -forgotten], white, zi=[forgotten * rng.normal()])
    return np.asarray(values)


@pytest.mark.parametrize("count", [300, 1600])
def test_white_noise_shares_nothing(count: int) -> None:
    rng = np.random.default_rng(21)
    for _ in range(10):
        noise = correlated_noise([rng.normal(0.0, 0.4, count) + rng.normal() for _ in range(12)], STEP_S)
        assert noise.parts == ()
        assert noise.white_std == pytest.approx(0.4, rel=0.05)


@pytest.mark.parametrize("decay_s", [1e-4, 3e-4, 1e-3])
def test_noise_of_first_order_is_found_with_its_decay(decay_s: float) -> None:
    rng = np.random.default_rng(22)
    noise = correlated_noise([0.5 * first_order(rng, 1600, decay_s) + 3.0 for _ in range(24)], STEP_S)
    (part,) = noise.parts
    assert part.decay_s == pytest.approx(decay_s, rel=0.1)
    assert noise.std == pytest.approx(0.5, rel=0.05)
    assert noise.white_std < 0.1


@pytest.mark.parametrize("frequency_hz", [50.0, 99.7])
@pytest.mark.parametrize("pieces", [1, 24])
def test_hum_is_found_with_its_frequency(frequency_hz: float, pieces: int) -> None:
    """Of 80 ms, four periods of 50 Hz: one tap tells its frequency to a hertz."""
    rng, times = np.random.default_rng(23), STEP_S * np.arange(1600)
    hum = [np.sin(2.0 * math.pi * (frequency_hz * times + rng.random())) for _ in range(pieces)]
    noise = correlated_noise([one + rng.normal(0.0, 0.5, 1600) for one in hum], STEP_S)
    (part,) = noise.parts
    assert part.frequency_hz == pytest.approx(frequency_hz, abs=1.0 if pieces == 1 else 0.3)
    assert part.std == pytest.approx(math.sqrt(0.5), rel=0.1)
    assert noise.white_std == pytest.approx(0.5, rel=0.05)
