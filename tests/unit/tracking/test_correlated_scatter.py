"""Scatter that is correlated from cycle to cycle: told from a level that walks, and its larger variance."""

import itertools

import numpy as np
import pytest

import impactcell
from impactcell.numerics import autocorrelation, scatter_correlation
from impactcell.numerics.autocorrelation import Autocorrelation
from impactcell.tracking.model_gap import gap_cusum
from impactcell.tracking.wear_batch import process_noise_adaptation

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
        state, correlation = scatter_correlation.update(state, innovation)
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
    told = scatter_correlation.variance_over_differences(correlation)
    assert told == pytest.approx(n * of_mean / half_of_differences, rel=1e-4)
    assert scatter_correlation.variance_over_scatter(correlation) == pytest.approx(n * of_mean, rel=1e-4)


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


def gap_alarms(correlation, captures, seed, *, designed):
    """Times at which a residual with correlated scatter raises the gap's alarm."""
    state, was, alarms = gap_cusum.GapState(), False, 0
    for cycle, value in enumerate(autoregressive(correlation, captures, seed)):
        done = gap_cusum.update(state, float(np.exp(0.05 * value)), cycle, designed, 1.0)
        state, is_now = done.state, bool(done.exceeds)
        alarms += is_now and not was
        was = is_now
    return alarms


@pytest.mark.parametrize("correlation", [0.2, 0.4])
def test_residuals_that_are_correlated_are_no_gap_of_the_model(correlation):
    """Taken for white, there were 59 (0.2) and 174 (0.4) alarms in these 50 000 captures, for 5 designed."""
    assert sum(gap_alarms(correlation, 10_000, seed, designed=1e4) for seed in range(5)) <= 10


def test_a_gap_that_opens_is_not_learned_as_correlation():
    values = autoregressive(0.0, 1100, 40)
    values[1000:] += 2.0
    state, found = gap_cusum.GapState(), []
    for cycle, value in enumerate(values):
        done = gap_cusum.update(state, float(np.exp(0.05 * value)), cycle, 1e5, 1.0)
        state = done.state
        found += [cycle] if done.exceeds else []
    assert 1000 <= found[0] < 1012
    assert len(found) > 80
