"""The in-cycle filter against filterpy, and the same bits however the samples are cut into blocks."""

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.serialization import pack
from impactcell.tracking.signature import in_cycle_filter


def slide(rate, n, seed=0):
    t = np.arange(n) / rate
    return 0.1 * t - 0.8 * t**2 + 0.42e-6 * np.random.default_rng(seed).normal(size=n)


@pytest.mark.parametrize(("rate", "density"), [(1e3, 1e3), (1e5, 1e3), (1e6, 1e5)])
def test_equals_filterpy(rate, density):
    n, T = 4000, 1.0 / rate
    z = slide(rate, n)
    _, ours = in_cycle_filter.update(in_cycle_filter.initial_state(T, 0.42e-6, density), z)
    oracle = KalmanFilter(3, 1)
    oracle.F = np.array([[1.0, T, T * T / 2.0], [0.0, 1.0, T], [0.0, 0.0, 1.0]])
    oracle.H = np.array([[1.0, 0.0, 0.0]])
    oracle.Q = in_cycle_filter.process_noise(T, density)
    oracle.R *= 0.42e-6**2
    oracle.x = np.zeros((3, 1))
    oracle.P = np.diag([100.0 * 0.42e-6**2, 1.0, 100.0])
    theirs = np.empty((n, 3))
    for k in range(n):
        oracle.predict()
        oracle.update(z[k])
        theirs[k] = oracle.x[:, 0]
    assert np.abs(ours - theirs).max(axis=0) / np.abs(theirs).max(axis=0) == pytest.approx(0.0, abs=1e-9)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(1, 4000), max_size=8))
def test_blocks_make_no_difference(cuts):
    z = slide(1e5, 4000)
    whole, expected = in_cycle_filter.update(in_cycle_filter.initial_state(1e-5, 0.42e-6, 1e3), z)
    state, parts = in_cycle_filter.initial_state(1e-5, 0.42e-6, 1e3), []
    for part in np.split(z, sorted(set(cuts))):
        state, filtered = in_cycle_filter.update(state, part)
        parts.append(filtered)
    assert np.concatenate(parts).tobytes() == expected.tobytes()
    assert pack(state) == pack(whole)


def test_the_gain_becomes_constant():
    state, _ = in_cycle_filter.update(in_cycle_filter.initial_state(1e-5, 0.42e-6, 1e3), slide(1e5, 3000))
    assert state.steady == in_cycle_filter.STEADY_SAMPLES
    again, _ = in_cycle_filter.update(state, slide(1e5, 100))
    assert again.gain.tobytes() == state.gain.tobytes()
