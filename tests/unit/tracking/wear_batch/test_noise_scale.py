"""The scale of the noise follows a cell whose scatter changes, and nothing else moves it."""

import numpy as np
import pytest

import impactcell
from impactcell.tracking.wear_batch import noise_scale
from impactcell.tracking.wear_batch.noise_scale import NoiseScale

STD = 0.002


def scales(values):
    """Standard deviation that is believed after each value, over the declared one; and the weight of it."""
    noise, believed, weights = NoiseScale(), [], []
    for value in values:
        noise, _ = noise_scale.update(noise, 0.2 + STD * value, STD, late=False, other_batch=False)
        believed.append(np.sqrt(noise_scale.usual_variance(noise)) / STD)
        weights.append(noise.weight)
    return np.array(believed), np.array(weights)


def scatter(seed, cycles=6000):
    return np.random.default_rng([13, seed]).normal(size=cycles)


@pytest.mark.parametrize("factor", [0.5, 1.5, 2.0, 4.0])
def test_a_scatter_that_changes_is_believed_within_three_hundred_cycles(factor):
    for seed in range(4):
        values = scatter(seed)
        values[3000:] *= factor
        believed, _ = scales(values)
        assert believed[2999] == pytest.approx(1.0, rel=0.06)
        assert believed[3300:] == pytest.approx(factor, rel=0.2)
        assert believed[-1] == pytest.approx(factor, rel=0.06)


def test_neither_outliers_nor_steps_are_a_change_of_the_scatter():
    values = scatter(5)
    outliers = np.random.default_rng(6).random(len(values)) < 0.03
    values[outliers] += 10.0 * np.random.default_rng(7).normal(size=outliers.sum())
    values += 3.0 * (np.arange(len(values)) // 100 % 2)
    _, weights = scales(values)
    assert (np.diff(weights) >= 0.0).all()


def test_scatter_of_heavy_tails_is_no_change_either():
    _, weights = scales(np.random.default_rng(8).standard_t(3, size=6000) / np.sqrt(3.0))
    assert (np.diff(weights) >= 0.0).all()


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_scatter_that_changes_is_a_change_of_batch_only_until_that_is_noticed(factor):
    """With the scale of before, twice the scatter gave one every 130 cycles from there on."""
    for seed in range(3):
        values = scatter(20 + seed, 4000)
        values[2000:] *= factor
        series = impactcell.track(np.arange(4000), 0.2 + STD * values, np.full(4000, STD))
        found = [alarm.cycle for alarm in series.alarms if alarm.alarm == "BatchShift"]
        assert len(found) <= 2
        assert all(2000 <= cycle < 2100 for cycle in found)
