"""Whether the change that an effect predicts occurs: by how well it fits, in however few shots."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from impactcell.discrepancy.data import prepare, split_held_out
from impactcell.discrepancy.search.encompassing import acting_shots, slope_of_factors, slope_of_traces
from impactcell.discrepancy.search.gap import Part
from impactcell.discrepancy.search.gap_measure import GapMeasure
from tests.discrepancy import study

SHOTS, SAMPLES, PIECES = 10, 400, 20
LENGTH = SAMPLES // PIECES
"""What is smooth is constant over so many samples: its correlation length."""


def smooth(rng: np.random.Generator, shots: int) -> np.ndarray:
    """Draw what is constant over each piece, of variance 1, shape (shots, SAMPLES)."""
    return np.repeat(rng.standard_normal((shots, PIECES)), LENGTH, axis=1)


def test_the_slope_is_that_of_a_regression_through_the_origin() -> None:
    rng = np.random.default_rng(1)
    change = rng.standard_normal(SHOTS)
    before = 0.8 * change + 0.3 * rng.standard_normal(SHOTS)
    found = slope_of_factors(before, before - change)
    fitted, residual, *_ = np.linalg.lstsq(change[:, None], before, rcond=None)
    std = math.sqrt(residual[0] / (SHOTS - 1) / (change @ change))
    assert found.value == pytest.approx(fitted[0])
    assert found.std == pytest.approx(std)
    assert found.p_value == pytest.approx(stats.t.sf((fitted[0] - 0.5) / std, SHOTS - 1))
    fall = before @ before - (before - change) @ (before - change)
    assert found.fall(0.5) == pytest.approx(fall)
    assert found.fall(0.025) < fall < found.fall(0.975)


@pytest.mark.parametrize("scale", [0.1, 1.0, 30.0])
def test_factors_that_fall_by_nothing_are_told_to_fall_as_rarely_as_stated(scale: float) -> None:
    rng = np.random.default_rng(2)
    change = scale * rng.standard_normal((4000, SHOTS))
    before = 0.5 * change + rng.standard_normal(change.shape)
    p_values = [slope_of_factors(b, b - c).p_value for b, c in zip(before, change, strict=True)]
    assert stats.kstest(p_values, "uniform").pvalue > 0.01


@pytest.mark.parametrize("alike", [True, False])
@pytest.mark.parametrize("acting", [1, 4])
def test_traces_that_fall_by_nothing_are_told_to_fall_no_more_often_than_stated(
    *, alike: bool, acting: int
) -> None:
    """Beside an error that is smooth, and alike in every shot or of its own in each."""
    rng = np.random.default_rng([3, acting])
    level, told = 1.5, []
    for _ in range(600):
        change = np.zeros((SHOTS, SAMPLES))
        change[:acting, 100 : 100 + 2 * LENGTH] = 4.0 * rng.standard_normal()
        error = smooth(rng, 1) if alike else smooth(rng, SHOTS)
        before = 0.5 * change + level * error + rng.standard_normal(change.shape)
        shots_changed = acting_shots((change**2).sum(1))
        slope = slope_of_traces(
            before.ravel(), (before - change).ravel(), shots_changed, level**2 * LENGTH, PIECES
        )
        told.append(slope.p_value <= 0.1)
    assert stats.binomtest(sum(told), len(told), 0.1, alternative="greater").pvalue > 0.01


def test_what_acts_in_one_shot_is_heard_where_it_fits() -> None:
    rng = np.random.default_rng(4)
    change = np.zeros((SHOTS, SAMPLES))
    change[3, 100:140] = 12.0
    left = 1.5 * smooth(rng, SHOTS) + rng.standard_normal(change.shape)
    acting = acting_shots((change**2).sum(1))
    assert acting == pytest.approx(1.0)
    there = slope_of_traces((left + change).ravel(), left.ravel(), acting, 1.5**2 * LENGTH, PIECES)
    not_there = slope_of_traces(left.ravel(), (left - change).ravel(), acting, 1.5**2 * LENGTH, PIECES)
    assert there.p_value < 0.001
    assert there.fall(0.025) > 0.0
    assert not_there.p_value > 0.5


def test_no_change_falls_by_nothing() -> None:
    nothing = np.zeros(SHOTS)
    assert slope_of_factors(nothing, nothing).p_value == 1.0
    assert slope_of_factors(nothing, nothing).fall(0.975) == 0.0
    assert acting_shots(np.ones(7)) == pytest.approx(7.0)


@pytest.mark.slow
def test_hard_and_light_taps_are_held_out_alike() -> None:
    job = study.Job("single", ("force_saturation",), 3, shots=40)
    prepared = prepare(study.campaign(job))
    energy = np.array([shot.mass_kg * shot.velocity_m_s**2 for shot in prepared.shots])
    hardest = energy >= np.sort(energy)[-len(energy) // 4]
    batch = np.array([shot.batch for shot in prepared.shots])
    for seed in range(60):
        training, held_out = split_held_out(prepared, seed)
        assert sorted([*training, *held_out]) == list(range(40))
        assert len(held_out) == 10
        assert 2 <= hardest[held_out].sum() <= 3
        assert 4 <= batch[held_out].sum() <= 6
        assert np.array_equal(split_held_out(prepared, seed)[1], held_out)
    assert len({tuple(split_held_out(prepared, seed)[1]) for seed in range(20)}) > 10


@pytest.mark.slow
def test_a_gap_that_one_tap_shows_is_seen_to_close_by_how_well_the_change_fits() -> None:
    """By signs at random p was 0.14 where the held-out gap fell from 5.2 to 1.1 noise floors."""
    found = study.name_effects(study.campaign(study.Job("single", ("viscous_friction",), 3, shots=24)))
    measure = GapMeasure(found.held_problem, found.floor, found.replicates, 0)
    bounds, count = found.held_problem.shots.bounds, found.held_problem.count
    rng = np.random.default_rng(5)
    left = rng.standard_normal(found.held_final.residual.size)
    bump = np.zeros(left.size)
    bump[bounds[2] + 20 : bounds[2] + 45] = 60.0
    elsewhere = np.zeros(left.size)  # what a model error makes of the other taps, for better and for worse
    for shot in range(3, count):
        elsewhere[bounds[shot] : bounds[shot] + 200] = 0.3 * (-1.0) ** shot
    before = replace(found.held_final, residual=left + bump + elsewhere)
    after = replace(found.held_final, residual=left)
    change = measure.change(before, after, [Part.TRACES])
    assert change.before.trace > 2.0
    assert change.is_real()
    assert 0.0 < change.low <= change.closed <= change.high
    missed = replace(found.held_final, residual=left + bump)
    worse = measure.change(missed, replace(missed, residual=left + bump - np.roll(bump, 100)), [Part.TRACES])
    assert not worse.is_real()
    assert worse.p_value > 0.5
