"""Walks of level and slope: found, and ended, by the likelihood of banks that run side by side."""

from dataclasses import replace

import numpy as np
import pytest

import impactcell
from impactcell.tracking import wear_batch
from impactcell.tracking.wear_batch import (
    BatchKnowledge,
    FrictionObservation,
    TrackerSettings,
    noise_scale,
    run_length_bank,
    walk_models,
)
from impactcell.tracking.wear_batch.noise_scale import NoiseScale
from impactcell.tracking.wear_batch.run_length_model import BankModel, Measurement

UNIT = 0.002
SETTINGS = TrackerSettings(batch=BatchKnowledge.UNKNOWN)
MODEL = BankModel(
    SETTINGS.hazard, SETTINGS.step_std**2, 0.0, 0.0, SETTINGS.outlier_probability, SETTINGS.slope_std**2
)


NEVER = -np.inf
"""Log odds of a scatter that grows, where it is not to be looked for."""


def white(seed, cycles):
    return np.random.default_rng([17, seed]).normal(size=cycles)


def walk(seed, cycles, scale):
    return scale * np.cumsum(white(100 + seed, cycles))


def swing(cycles, size, period):
    return size * np.sin(2.0 * np.pi * np.arange(cycles) / period)


def first_bank(value):
    return run_length_bank.initial_bank(value, 1.0, SETTINGS.slope_std, 0, SETTINGS.outlier_probability)


def measurement(value, cycle):
    return Measurement(float(value), 1.0, 1.0, 0.0, float(cycle), 0.0)


def believed(values):
    """Walks that are believed after each cycle, level and slope, in standard deviations of an estimate."""
    models = walk_models.begin(first_bank(values[0]), (0.0, 0.0), (0.0, 0.0), 1.0)
    found = [(0.0, 0.0)]
    for cycle, value in enumerate(values[1:], 1):
        models, _ = taken_in(models, value, cycle)
        models = walk_models.believing(models, NEVER, 0.0)
        level, slope, _ = np.sqrt(models.variances[models.believed])
        found.append((float(level), float(slope)))
    return found


def taken_in(models, value, cycle, log_odds=NEVER):
    """Models with a cycle in them, and the statistic of a change where they were brought up to date."""
    models = walk_models.append(models, measurement(value, cycle))
    if len(models.cycles) < walk_models.TOGETHER:
        return models, None
    return walk_models.take_in(models, MODEL, 0, log_odds)


def test_the_evidence_is_how_much_more_likely_the_cycles_are_under_another_walk():
    values = white(0, 1 + walk_models.TOGETHER) + np.arange(1.0 + walk_models.TOGETHER)
    models = walk_models.begin(first_bank(values[0]), (0.0, 0.0), (0.0, 0.0), 1.0)
    for cycle, value in enumerate(values[1:], 1):
        assert not np.any(models.evidence)
        models, _ = taken_in(models, value, cycle)
    likelihoods = []
    for level, slope, scatter in (*((*walk, 1.0) for walk in walk_models.WALKS), (0.0, 0.0, 2.0)):
        bank, outliers = run_length_bank.workspace(first_bank(values[0])), np.zeros(2)
        count, total = 2, 0.0
        model = MODEL._replace(level_variance=level**2, slope_variance=slope**2)
        for cycle, value in enumerate(values[1:], 1):
            seen = measurement(value, cycle)._replace(variance=scatter**2)
            count, density, _, _ = run_length_bank.update(bank, count, model, seen, outliers, 0.0)
            total += density
        likelihoods.append(total)
        np.testing.assert_allclose(
            models.banks[len(likelihoods) - 1], run_length_bank.stored(bank, count), rtol=1e-9
        )
    expected = np.maximum(np.array(likelihoods) - likelihoods[0], 0.0)
    np.testing.assert_allclose(models.evidence, expected, rtol=1e-9, atol=1e-9)
    assert len(models.cycles) == 0


@pytest.mark.slow
def test_of_white_scatter_no_walk_is_believed_nor_of_batches_of_some_hundred_cycles():
    assert set(believed(white(1, 6000))) == {(0.0, 0.0)}
    steps = np.cumsum(np.where(np.arange(6000) % 300 == 299, 5.0 * white(2, 6000), 0.0))
    assert set(believed(white(3, 6000) + steps)) == {(0.0, 0.0)}


@pytest.mark.slow
def test_a_level_that_walks_is_found_and_when_it_ends():
    values = white(4, 9000) + np.append(walk(4, 4500, 0.05), np.full(4500, walk(4, 4500, 0.05)[-1]))
    found = believed(values)
    assert any(level > 0.0 for level, _ in found[:3000])
    assert set(found[8000:]) == {(0.0, 0.0)}


def test_a_level_that_swings_is_a_slope_that_walks():
    found = believed(white(5, 4000) + swing(4000, 3.0, 2000))
    assert found[-1][1] > 0.0


def test_the_walk_that_was_commissioned_is_among_those_that_are_compared():
    models = walk_models.begin(first_bank(0.0), (0.0, 0.0), (0.01**2, 0.0), 1.0)
    assert models.variances[models.believed].tolist() == [0.01**2, 0.0, 1.0]
    assert models.variances[-1].tolist() == [0.01**2, 0.0, 4.0]
    assert len(models.variances) == len(walk_models.WALKS) + 2
    assert len(walk_models.begin(first_bank(0.0), (0.0, 0.0), (0.0, 0.0), 1.0).variances) == 1 + len(
        walk_models.WALKS
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("level", "before"),
    [(swing(5000, 3.0, 2000), 25), (swing(5000, 1.0, 2000), 11), (walk(6, 5000, 0.05), 17)],
    ids=["swings by 3", "swings by 1", "walks"],
)
def test_a_level_that_moves_slowly_is_few_changes_of_batch(level, before):
    """`before`: what it was when the bank explained it all by steps."""
    values = 0.2 + UNIT * (white(7, 5000) + level)
    series = impactcell.track(np.arange(5000), values, np.full(5000, UNIT))
    found = [alarm.cycle for alarm in series.alarms if alarm.alarm == "BatchShift"]
    assert len(found) <= before // 2
    assert all(cycle < 3000 for cycle in found)


@pytest.mark.slow
@pytest.mark.parametrize("knowledge", BatchKnowledge)
def test_the_tracker_takes_the_bank_of_the_walk_that_it_believes(knowledge):
    settings, state, notes = TrackerSettings(batch=knowledge), wear_batch.initial_state(), []
    for cycle, value in enumerate(0.2 + UNIT * (white(8, 3000) + swing(3000, 3.0, 1000))):
        done = wear_batch.update(settings, state, FrictionObservation(cycle, value, UNIT, cycle * 10**9, "A"))
        notes += [(cycle, note) for note in done.notes if "from cycle to cycle" in note]
        state = done.state
    ((cycle, note),) = notes
    assert "unsteadily" in note
    assert cycle < 2000
    assert state.walk_models is not None
    level, slope, _ = state.walk_models.variances[state.walk_models.believed]
    assert (state.level_variance, state.slope_variance) == (level, slope)
    assert slope > 0.0


def bank_of(values, variance):
    """The bank alone after all but the first of the values, and the log likelihood of them."""
    bank, count, outliers, total = run_length_bank.workspace(first_bank(values[0])), 2, np.zeros(2), 0.0
    for cycle, value in enumerate(values[1:], 1):
        seen = measurement(value, cycle)._replace(variance=variance)
        count, density, *_ = run_length_bank.update(bank, count, MODEL, seen, outliers, 0.0)
        total += density
    return bank, count, total


@pytest.mark.slow
def test_a_change_that_is_taken_back_leaves_no_offset_in_the_level_of_a_known_batch():
    """Wear that accelerates has some until its slope is seen to walk: 5 and 8 deviations were left."""
    cycles = np.arange(1, 801)
    for seed in (2, 4):
        level = 0.2 + 0.02 * (cycles / 800.0) ** 2
        found = impactcell.track(
            cycles, level + UNIT * white(40 + seed, 800), np.full(800, UNIT), batch=["A"] * 800
        )
        assert any(alarm.alarm == "BatchShift" for alarm in found.alarms)
        assert abs(found.wear.level - level[-1]) < 2.0 * found.wear.level_std


def test_a_change_is_weighed_under_both_scatters_by_how_probable_they_are():
    values = np.append(white(9, 13), 2.5 * white(10, walk_models.TOGETHER - 12))
    models, statistic = walk_models.begin(first_bank(values[0]), (0.0, 0.0), (0.0, 0.0), 1.0), None
    for cycle, value in enumerate(values[1:], 1):
        models, statistic = taken_in(models, value, cycle, np.log(1e-3))
    odds, likelihoods = [], []
    for variance in (1.0, 4.0):
        bank, count, likelihood = bank_of(values, variance)
        changed, unchanged = run_length_bank.change_weights(
            bank, count, MODEL, measurement(values[-1], walk_models.TOGETHER), 0.0
        )
        odds.append(np.exp([changed, unchanged]))
        likelihoods.append(likelihood)
    grown = 1e-3 * np.exp(max(likelihoods[1] - likelihoods[0], 0.0))
    changed, unchanged = odds[0] + grown * odds[1]
    assert grown > 0.1
    assert statistic == pytest.approx(np.log(changed / unchanged / MODEL.hazard), rel=1e-9)


def test_a_larger_scatter_is_believed_where_it_is_ten_times_as_probable():
    models = walk_models.begin(first_bank(0.0), (0.0, 0.0), (0.0, 0.0), 1.0)
    last = len(models.variances) - 1
    for nats, expected in ((2.2, 0), (2.4, last)):
        evidence = np.append(np.zeros(last), nats - np.log(1e-4))
        likelier = walk_models.believing(replace(models, evidence=evidence), np.log(1e-4), 0.0)
        assert likelier.believed == expected


@pytest.mark.parametrize(("correlation", "worth"), [(0.0, 1.0), (0.5, 3.0), (0.8, 9.0)])
def test_of_correlated_scatter_a_walk_is_asked_for_as_many_nats_more_as_cycles_are_worth_less(
    correlation, worth
):
    """A mean of n has the variance of one of n / worth that are independent; a walk ends as it does else."""
    models = walk_models.begin(first_bank(0.0), (0.0, 0.0), (0.0, 0.0), 1.0)
    for believed_now, likelier, nats, expected in (
        (0, 3, 0.99 * worth, 0),
        (0, 3, 1.01 * worth, 3),
        (3, 0, 0.99, 3),
        (3, 0, 1.01, 0),
    ):
        evidence = np.zeros(len(models.variances))
        evidence[likelier] = nats * walk_models.CLEARLY
        asked = replace(models, believed=believed_now, evidence=evidence)
        assert walk_models.believing(asked, NEVER, correlation).believed == expected


def test_a_scatter_grows_beside_the_walk_that_is_believed():
    models = walk_models.begin(first_bank(0.0), (0.0, 0.0), (0.0, 0.0), 1.0)
    evidence = np.array([0.0, 0.0, 10.0, 0.0, 0.0, 0.0])
    walking = walk_models.believing(replace(models, evidence=evidence), NEVER, 0.0)
    assert walking.believed == 2
    np.testing.assert_allclose(walking.variances[-1], [0.1**2, 0.0, 4.0])
    assert not walking.evidence.any()


@pytest.mark.slow
def test_a_scatter_that_doubles_is_soon_believed_and_told_of_no_batch():
    """Weighed under the scatter of before alone there were nine changes of batch in these."""
    for seed in range(17, 24):
        state, values, found = wear_batch.initial_state(), white(seed, 400), 0
        values[330:] *= 2.0
        for cycle, value in enumerate(0.2 + UNIT * values):
            done = wear_batch.update(SETTINGS, state, FrictionObservation(cycle, value, UNIT))
            state = done.state
            found += done.shift is not None
        assert found == 0
        assert 1.5 < np.sqrt(noise_scale.usual_variance(state.noise)) / UNIT < 3.0


def test_the_more_often_the_scatter_has_changed_the_sooner_it_is_asked():
    noise = NoiseScale()
    assert np.exp(noise_scale.log_odds_of_growth(noise)) == pytest.approx(noise_scale.GROWTH)
    grown = noise_scale.rescaled(noise_scale.rescaled(noise, 4.0), 0.25)
    assert grown.factor == noise.factor
    assert np.exp(noise_scale.log_odds_of_growth(grown)) == pytest.approx(noise_scale.GROWTH + 2.0 / 5000.0)
    for cycle in range(1000):
        grown, _ = noise_scale.update(grown, 0.2 + 0.001 * (cycle % 2), UNIT, late=False, other_batch=False)
    assert grown.rescalings <= 2.0 * (1.0 - 1.0 / 5000.0) ** 1000 + 1.0
