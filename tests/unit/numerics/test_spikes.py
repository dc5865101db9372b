"""Lone samples that are neither noise nor motion, and all that looks like them and is motion."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.numerics.spikes import noise_of, spike_samples

NOISE = 0.4


def contact(samples: int = 400) -> np.ndarray:
    """A jump, a half wave, a second jump down and rest, with noise."""
    at = np.arange(samples)
    force = np.where((at >= 50) & (at < 250), 30.0 + 300.0 * np.sin(np.pi * (at - 50) / 260.0), 0.0)
    return force + np.random.default_rng(1).normal(0.0, NOISE, samples)


@settings(max_examples=200, deadline=None)
@given(
    place=st.integers(6, 390),
    height=st.floats(25.0, 1e9) | st.floats(-1e9, -25.0),
    width=st.sampled_from([1, 2]),
)
def test_a_spike_of_one_or_two_samples_is_found_where_it_is(place: int, height: float, width: int) -> None:
    values = contact()
    # Beside a jump a spike can pass for a part of it.
    if min(abs(place + i - jump) for jump in (50, 250) for i in (0, 1)) < 8:
        place = 100
    values[place : place + width] += height
    assert spike_samples(values).tolist() == list(range(place, place + width))


def test_jumps_kinks_and_peaks_are_no_spikes() -> None:
    at = np.arange(300.0)
    for signal in (
        contact(),
        np.where(at < 100, 7.0 * at, 700.0 - 16.0 * (at - 100)),  # a kink at the top
        np.where(at < 100, 7.0 * at, 200.0),  # a jump from the top
        np.where(at < 100, 0.0, np.where(at < 101, 15.0, 6.0)),  # met again one sample before the halt
        np.where(at < 100, -10.0, np.where(at < 102, 20.0, 6.0)),
        np.abs(200.0 * np.sin(at / 4.0)),  # contacts of few samples
        np.maximum(0.0, 200.0 * np.sin(at / 2.0)),
        np.round(at / 7.0),
        np.zeros(300),
    ):
        assert spike_samples(signal).size == 0
        assert spike_samples(signal + np.random.default_rng(2).normal(0.0, 0.05, len(signal))).size == 0


@pytest.mark.parametrize("samples", [0, 1, 5, 15, 16])
def test_few_samples_tell_of_no_spike(samples: int) -> None:
    values = np.random.default_rng(3).standard_normal(samples)
    values[samples // 2 : samples // 2 + 1] = 1e3
    assert spike_samples(values).size == (samples >= 16)


def test_noise_is_that_of_neighbours() -> None:
    values = np.random.default_rng(4).normal(0.0, NOISE, 5000) + np.linspace(0.0, 100.0, 5000)
    assert noise_of(values) == pytest.approx(NOISE, rel=0.05)
    assert noise_of(np.zeros(4)) == 0.0


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 10**6), st.integers(16, 300))
def test_white_noise_has_none(seed: int, samples: int) -> None:
    assert spike_samples(np.random.default_rng(seed).standard_normal(samples)).size == 0
