"""Walks of level and slope: found, and ended, by the likelihood of banks that run side by side."""

import numpy as np
import pytest

import impactcell
from impactcell.tracking import wear_batch
from impactcell.tracking.wear_batch import (
    BatchKnowledge,
    FrictionObservation,
    TrackerSettings,
    run_length_bank,
    walk_models,
)
from impactcell.tracking.wear_batch.run_length_model import BankModel, Measurement

UNIT = 0.002
SETTINGS = TrackerSettings(batch=BatchKnowledge.UNKNOWN)
MODEL = BankModel(
    SETTINGS.hazard, SETTINGS.step_std**2, 0.0, 0.0, SETTINGS.outlier_probability, SETTINGS.slope_std**2
)


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
        models = walk_models.update(models, measurement(value, cycle), MODEL, 0)
        level, slope = np.sqrt(models.variances[models.believed])
        found.append((float(level), float(slope)))
    return found


def test_the_evidence_is_how_much_more_likely_the_cycles_are_under_another_walk():
    values = white(0, 1 + walk_models.TOGETHER) + np.arange(1.0 + walk_models.TOGETHER)
    models = walk_models.begin(first_bank(values[0]), (0.0, 0.0), (0.0, 0.0), 1.0)
    for cycle, value in enumerate(values[1:], 1):
        assert not np.any(models.evidence)
        models = walk_models.update(models, measurement(value, cycle), MODEL, 0)
    likelihoods = []
    for level, slope in walk_models.WALKS:
        bank, outliers = run_length_bank.workspace(first_bank(values[0])), np.zeros(2)
        count, total = 2, 0.0
        model = MODEL._replace(level_variance=level**2, slope_variance=slope**2)
        for cycle, value in enumerate(values[1:], 1):
            count, density, _, _ = run_length_bank.update(
                bank, count, model, measurement(value, cycle), outliers, 0.0
            )
            total += density
        likelihoods.append(total)
        np.testing.assert_allclose(
            models.banks[len(likelihoods) - 1], run_length_bank.stored(bank, count), rtol=1e-9
        )
    expected = np.maximum(np.array(likelihoods) - likelihoods[0], 0.0)
    np.testing.assert_allclose(models.evidence, expected, rtol=1e-9, atol=1e-9)
    assert len(models.cycles) == 0


def test_of_white_scatter_no_walk_is_believed_nor_of_batches_of_some_hundred_cycles():
    assert set(believed(white(1, 6000))) == {(0.0, 0.0)}
    steps = np.cumsum(np.where(np.arange(6000) % 300 == 299, 5.0 * white(2, 6000), 0.0))
    assert set(believed(white(3, 6000) + steps)) == {(0.0, 0.0)}


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
    assert models.variances[models.believed].tolist() == [0.01**2, 0.0]
    assert len(models.variances) == len(walk_models.WALKS) + 1
    assert len(walk_models.begin(first_bank(0.0), (0.0, 0.0), (0.0, 0.0), 1.0).variances) == len(
        walk_models.WALKS
    )


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


@pytest.mark.parametrize("knowledge", BatchKnowledge)
def test_the_tracker_takes_the_bank_of_the_walk_that_it_believes(knowledge):
    settings, state, notes = TrackerSettings(batch=knowledge), wear_batch.initial_state(), []
    for cycle, value in enumerate(0.2 + UNIT * (white(8, 3000) + swing(3000, 3.0, 1000))):
        done = wear_batch.update(settings, state, FrictionObservation(cycle, value, UNIT, cycle * 10**9, "A"))
        notes += [(cycle, note) for note in done.notes]
        state = done.state
    ((cycle, note),) = notes
    assert "unsteadily" in note
    assert cycle < 2000
    assert state.walk_models is not None
    level, slope = state.walk_models.variances[state.walk_models.believed]
    assert (state.level_variance, state.slope_variance) == (level, slope)
    assert slope > 0.0
