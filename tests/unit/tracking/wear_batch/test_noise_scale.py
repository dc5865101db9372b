"""The scale of the noise follows a cell whose scatter changes, and nothing else moves it."""

import numpy as np
import pytest

import impactcell
from impactcell.tracking.wear_batch import noise_scale
from impactcell.tracking.wear_batch.noise_scale import GUESSED_RELATIVE_STD, NoiseScale

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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.parametrize("relative", [0.003, 0.01, 0.03])
@pytest.mark.parametrize("cycles", [3, 4, 6, 8])
def test_few_values_without_standard_deviations_are_as_unsure_as_they_are(cycles, relative):
    """Of 95 % intervals of the level 82 % held it at four cycles, of one stream it was 39 deviations off."""
    beyond = []
    for seed in range(150):
        noise = np.random.default_rng([14, seed, cycles]).normal(size=cycles)
        wear = impactcell.track(np.arange(cycles), 0.2 * (1.0 + relative * noise)).wear
        beyond.append(((wear.level - 0.2) / wear.level_std, wear.rate_per_cycle / wear.rate_std))
    for off in np.abs(beyond).T:
        assert (off < 1.96).mean() > 0.92
        assert off.max() < (6.0 if relative <= GUESSED_RELATIVE_STD else 8.0)


def test_four_values_three_of_which_are_all_but_the_same_do_not_hide_the_truth():
    wear = impactcell.track(np.arange(4), [0.2005, 0.2035, 0.2033, 0.2035]).wear
    assert abs(wear.level - 0.2003) < 2.0 * wear.level_std < 0.01


@pytest.mark.parametrize("cycles", [2, 4])
def test_values_that_do_not_differ_are_no_better_than_the_guess(cycles):
    """The level was 0.20000 ± 0.00000 from the fourth on."""
    wear = impactcell.track(np.arange(cycles), np.full(cycles, 0.2)).wear
    assert wear.level == pytest.approx(0.2)
    assert wear.level_std > GUESSED_RELATIVE_STD * 0.2 / np.sqrt(cycles)


def test_the_first_difference_is_the_first_that_is_learned_from():
    wear = impactcell.track(np.arange(7), [0.2, 0.2, 0.2, 0.2, 0.201, 0.199, 0.2004]).wear
    assert 1e-4 < wear.level_std < 3e-3
