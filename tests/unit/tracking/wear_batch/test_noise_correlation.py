"""Scatter that is correlated from cycle to cycle: told from a level that walks, and its larger variance."""

import itertools

import numpy as np
import pytest

import impactcell
from impactcell.tracking.wear_batch import autocorrelation, noise_correlation, process_noise_adaptation
from impactcell.tracking.wear_batch.autocorrelation import Autocorrelation

UNIT = 0.002


def autoregressive(correlation, cycles, seed):
    """x_t = a x_(t-1) + e_t with variance one, from its stationary distribution."""
    draw = np.random.default_rng([11, seed])
    innovations = draw.normal(size=cycles) * np.sqrt(1.0 - correlation**2)
    innovations[0] = draw.normal()
    return np.array([*itertools.accumulate(innovations, lambda x, e: correlation * x + e)])


def learned(innovations):
    state, told = Autocorrelation(), []
    for innovation in innovations:
        state, correlation = noise_correlation.update(state, innovation)
        told.append(correlation)
    return np.array(told)


def factors(innovations):
    state, told = Autocorrelation(), []
    for innovation in innovations:
        state, factor = process_noise_adaptation.update(state, innovation)
        told.append(factor)
    return told


def test_sums_are_those_of_the_definition():
    innovations = autoregressive(0.4, 300, 0)
    state = Autocorrelation()
    for innovation in innovations:
        state = autocorrelation.update(state, innovation, 1e9)
    clipped = np.clip(innovations, -autocorrelation.CLIP, autocorrelation.CLIP)
    lagged = [clipped[lag:] @ clipped[:-lag] for lag in range(1, autocorrelation.LAGS + 1)]
    np.testing.assert_allclose(state.products, lagged, rtol=1e-5)
    assert state.square == pytest.approx(clipped @ clipped, rel=1e-5)
    assert state.weight == pytest.approx(300, rel=1e-5)
    assert autocorrelation.next_to(state) == pytest.approx(lagged[0] / (clipped @ clipped), rel=1e-4)


def test_an_innovation_that_is_none_changes_nothing():
    state = autocorrelation.update(Autocorrelation(), 1.0, 100.0)
    assert autocorrelation.update(state, float("nan"), 100.0) is state


@pytest.mark.parametrize("correlation", [0.0, 0.1, 0.3, 0.5, 0.6])
def test_the_correlation_of_the_scatter_is_learned(correlation):
    told = learned(autoregressive(correlation, 12_000, 1))
    assert told[-1] == pytest.approx(correlation, abs=0.05)


def test_a_level_that_walks_is_no_correlation_of_the_scatter():
    innovations = np.sqrt(0.3) * autoregressive(0.97, 12_000, 2) + np.sqrt(0.7) * autoregressive(
        0.0, 12_000, 3
    )
    assert learned(innovations)[-1] < 0.06


def test_scatter_that_is_correlated_is_no_level_that_walks():
    assert set(factors(autoregressive(0.4, 12_000, 4))) == {1.0}


def test_a_level_that_walks_raises_the_process_noise_and_one_that_does_not_lowers_it():
    walking = np.sqrt(0.3) * autoregressive(0.97, 3000, 5) + np.sqrt(0.7) * autoregressive(0.0, 3000, 6)
    assert process_noise_adaptation.STEP in factors(walking)
    assert 1.0 / process_noise_adaptation.STEP in factors(autoregressive(-0.3, 3000, 7))
    assert set(factors(autoregressive(0.0, 12_000, 8))) == {1.0}


@pytest.mark.parametrize("correlation", [0.0, 0.2, 0.5])
def test_the_variance_is_that_of_a_mean_of_many(correlation):
    """Bartlett's sum over lags for a mean of n, over half the variance of differences."""
    n = 100_000
    lags = np.arange(1, n)
    of_mean = (1.0 + 2.0 * np.sum((1.0 - lags / n) * correlation**lags)) / n
    half_of_differences = 1.0 - correlation
    assert noise_correlation.variance_factor(correlation) == pytest.approx(
        n * of_mean / half_of_differences, rel=1e-4
    )


def shifts(values):
    series = impactcell.track(np.arange(len(values)), 0.2 + UNIT * values, np.full(len(values), UNIT))
    return [alarm.cycle for alarm in series.alarms if alarm.alarm == "BatchShift"]


@pytest.mark.parametrize("correlation", [0.2, 0.5])
def test_scatter_that_is_correlated_is_no_change_of_batch(correlation):
    """Taken for white, it gave one in some 1500 (0.2) and 400 (0.5) cycles: about 8 and 30 here."""
    assert sum(len(shifts(autoregressive(correlation, 3000, 20 + seed))) for seed in range(4)) <= 1


def test_a_change_of_batch_in_correlated_scatter_is_found():
    values = autoregressive(0.2, 2000, 30)
    values[1200:] += 2.5
    (found,) = shifts(values)
    assert 1200 <= found < 1220
