"""Block means: against models solved in one piece, bounded in size, and begun in the middle."""

import math
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from impactcell.journal.migrations import STATE_MIGRATIONS
from impactcell.tracking import wear_batch
from impactcell.tracking.wear_batch import (
    BatchKnowledge,
    FrictionObservation,
    TrackerSettings,
    block_filter,
    initial_state,
    slope_grid,
    wear_blocks,
)
from impactcell.tracking.wear_batch.block_filter import BLOCK, STEP_SCALES, STEP_SHARES, BlockModel

UNKNOWN = TrackerSettings(wear_limit=0.25, batch=BatchKnowledge.UNKNOWN)
STD = 0.002
MODEL = BlockModel(variance=STD**2, step_variance=16.0 * STD**2, level_walk=0.0)
SURELY_NONE, ANNOUNCED = -1.0, 1.0


def taken(values, cycles, change=None, model=MODEL):
    wear = wear_blocks.begin(int(cycles[0]), values[0], 0.1)
    for k, (cycle, value) in enumerate(zip(cycles.tolist(), values.tolist(), strict=True)):
        told = ANNOUNCED if change is not None and k == change else SURELY_NONE
        wear = wear_blocks.update(wear_blocks.append(wear, cycle, value, 1.0, told), model)
    return wear


def test_evidence_level_and_variance_of_each_slope_are_those_of_the_model_in_one_piece():
    """One announced step of one of three sizes: a mixture of three normal distributions of all blocks."""
    rng = np.random.default_rng(1)
    cycles = np.arange(6) * 16.0
    weight = rng.uniform(4.0, 16.0, 6)
    values = (
        0.2 + 3e-6 * cycles + np.where(np.arange(6) >= 3, 2.0 * STD, 0.0) + 0.3 * STD * rng.normal(size=6)
    )
    told = np.where(np.arange(6) == 3, ANNOUNCED, SURELY_NONE)
    blocks = np.column_stack([weight, cycles, values, told])
    before = 4.0 * STD**2  # level and total, which begin as one
    mean, covariance = np.array([0.0, 0.2, 0.2]), np.full((3, 3), before)
    covariance[0] = covariance[:, 0] = 0.0
    covariance[0, 0] = 1e-10
    grid = np.array([-1e-5, 0.0, 3e-6, 1e-5])
    walk = 0.01 * STD**2
    model = MODEL._replace(level_walk=walk)
    wear = wear_blocks.WearBlocks(0.0, mean, covariance / STD**2)
    prior, segments = wear_blocks.before_blocks(wear, grid, STD**2)
    assert prior == pytest.approx(-0.5 * grid**2 / 1e-10)
    evidence = block_filter.filter_slopes(grid, segments, blocks[:4], 0.0, 0.0, model)
    evidence += block_filter.filter_slopes(grid, segments, blocks[4:], 0.0, cycles[3], model)
    weighed = block_filter.levels(segments)
    later = (np.arange(6) >= 3).astype(float)
    walked = walk * np.minimum.outer(cycles, cycles)
    for slope, log_evidence, row in zip(grid, evidence, weighed, strict=True):
        densities, levels, squares = [], [], []
        for scale in STEP_SCALES:
            spread = before + walked + scale**2 * MODEL.step_variance * np.outer(later, later)
            spread = spread + np.diag(STD**2 / weight)
            z = values - slope * cycles - 0.2
            densities.append(multivariate_normal.pdf(z, np.zeros(6), spread))
            # the level after the last block, whose walk is that of all before
            crossed = before + walk * np.minimum(cycles, cycles[-1])
            gain = np.linalg.solve(spread, crossed)
            level = 0.2 + gain @ z
            levels.append(level)
            squares.append(before + walk * cycles[-1] - gain @ crossed + level**2)
        share = STEP_SHARES * densities / (STEP_SHARES @ densities)
        assert log_evidence == pytest.approx(math.log(STEP_SHARES @ densities), abs=1e-9)
        assert row[0] == pytest.approx(share @ levels, abs=1e-12)
        assert row[1] == pytest.approx(share @ squares - (share @ levels) ** 2, rel=1e-6)


def test_a_step_within_a_block_is_weighed_by_the_part_of_it_that_the_block_has():
    """Two blocks, a change with the second: normal distributions of both, one for each size and each part."""
    hazard, values, weight = 8.0 * block_filter.HAZARD, np.array([0.2, 0.2 + 3.0 * STD]), 8.0
    before = 4.0 * STD**2
    covariance = np.full((3, 3), before)
    covariance[0] = covariance[:, 0] = 0.0
    covariance[0, 0] = 1e-10
    wear = wear_blocks.WearBlocks(0.0, np.array([0.0, 0.2, 0.2]), covariance / STD**2)
    blocks = np.array([[weight, 0.0, values[0], SURELY_NONE], [weight, 8.0, values[1], 0.0]])
    _, segments = wear_blocks.before_blocks(wear, np.array([0.0]), STD**2)
    evidence = block_filter.filter_slopes(np.array([0.0]), segments, blocks, 0.0, 0.0, MODEL)
    share, parts, steps = [1.0 - hazard], [0.0], [0.0]
    for part in block_filter.PARTS:
        for size, scale in zip(STEP_SHARES, STEP_SCALES, strict=True):
            share.append(hazard * size * (1.0 / 8.0 if part == 1.0 else 7.0 / 24.0))
            parts.append(part)
            steps.append(scale**2 * MODEL.step_variance)
    z, densities, totals = values - 0.2, [], []
    for part, step in zip(parts, steps, strict=True):
        spread = before + np.diag(np.full(2, STD**2 / weight)) + step * np.diag([0.0, part**2])
        densities.append(multivariate_normal.pdf(z, np.zeros(2), spread))
        totals.append(0.2 + (before + step * np.array([0.0, part])) @ np.linalg.solve(spread, z))
    joint = np.array(share) * densities
    assert evidence[0] == pytest.approx(math.log(joint.sum()), abs=1e-9)
    found = segments[0][segments[0]["probability"] > 0.0]
    assert found["probability"] @ found["total"] == pytest.approx(joint @ totals / joint.sum(), abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("change", [65, 67, 70])
def test_a_batch_that_changes_within_a_block_does_not_pass_for_wear(change):
    """By least squares with the change told there is no wear: a block half way up was the begin of some."""
    pulls = []
    for seed in range(40):
        values = 0.2 + STD * np.random.default_rng([23, seed]).normal(size=120)
        values[change:] += 6.0 * STD
        wear = wear_blocks.begin(0, values[0], 0.3)
        for cycle, value in enumerate(values.tolist()):
            wear = wear_blocks.update(wear_blocks.append(wear, cycle, value, 1.0, 0.0), MODEL)
        found = wear_blocks.moments(wear, 119)
        pulls.append((found.level - 0.2) / math.sqrt(found.level_variance))
    assert np.mean(pulls) < 0.75
    assert sum(abs(pull) < 1.96 for pull in pulls) >= 34


def test_what_is_known_at_some_slopes_is_known_at_others_without_the_blocks():
    """Of one history of changes exactly: the blocks taken in at those slopes say the same."""
    rng = np.random.default_rng(7)
    cycles = 8.0 * np.arange(40)
    values = 0.2 + 2e-6 * cycles + 0.3 * STD * rng.normal(size=40)
    blocks = np.column_stack([np.full(40, 8.0), cycles, values, np.full(40, SURELY_NONE)])
    wear = wear_blocks.begin(0, 0.2, 0.1)
    grid, others = np.linspace(-1e-5, 1e-5, 5), np.linspace(-6e-6, 9e-6, 5)
    evidence, segments = wear_blocks.before_blocks(wear, grid, STD**2)
    evidence += block_filter.filter_slopes(grid, segments, blocks, 0.0, 0.0, MODEL)
    expected, straight = wear_blocks.before_blocks(wear, others, STD**2)
    expected += block_filter.filter_slopes(others, straight, blocks, 0.0, 0.0, MODEL)
    moved = np.zeros_like(segments)
    gained = slope_grid.relay(grid, segments, others, moved, (0.0, 1e-5))
    nearest = np.abs(grid - others[:, None]).argmin(axis=1)
    assert evidence[nearest] + gained == pytest.approx(expected, abs=1e-6)
    assert block_filter.levels(moved) == pytest.approx(block_filter.levels(straight), rel=1e-9)


def test_beyond_the_grid_it_falls_as_a_normal_distribution_does():
    wear = wear_blocks.begin(0, 0.2, 0.1)
    grid = np.linspace(1e-5, 2e-5, 5)
    _, segments = wear_blocks.before_blocks(wear, grid, STD**2)  # steep: likelier the nearer to no wear
    mean, std, onto = 1.5e-5, 2.5e-6, np.array([0.0, 5e-6, 1e-5])
    gained = slope_grid.relay(grid, segments, onto, np.zeros_like(segments[:3]), (mean, std))
    normal = -0.5 * ((onto - mean) ** 2 - (grid[0] - mean) ** 2) / std**2
    assert gained == pytest.approx(normal, abs=1e-9)


def test_segments_that_have_become_impossible_are_left_out_and_the_others_stay():
    segments = np.zeros((1, block_filter.SEGMENTS, block_filter.WIDTH)).view(block_filter.SEGMENT)[..., 0]
    segments["probability"][0, :3] = 0.3, 0.3, 0.4
    segments["log_by_slope"][0, :3] = -1e9, 1e9, 1e9
    segments["change"][0, :3] = 1.0, 2.0, 3.0
    moved = np.zeros_like(segments)
    slope_grid.relay(np.zeros(1), segments, np.array([1e-5]), moved, (0.0, 1.0))
    assert moved["change"][0, :2].tolist() == [2.0, 3.0]
    assert moved["probability"][0] == pytest.approx([3.0 / 7.0, 4.0 / 7.0, *[0.0] * 10])


def test_a_long_run_stays_small_and_loses_nothing_of_the_slope():
    """Without batches it is a line through all cycles, whatever has been forgotten on the way."""
    cycles = 25 * np.arange(3600)
    values = 0.2 + 1e-8 * cycles + STD * np.random.default_rng(2).normal(size=len(cycles))
    wear = taken(values, cycles)
    assert len(wear.blocks) <= 2
    assert wear.segments.shape == (len(wear_blocks.OFFSETS), block_filter.SEGMENTS, block_filter.WIDTH)
    found = wear_blocks.moments(wear, int(cycles[-1]))
    used = (len(cycles) // BLOCK - 1) * BLOCK
    line, spread = np.polyfit(cycles[:used], values[:used], 1, cov="unscaled")
    std = STD * math.sqrt(spread[0, 0])
    assert abs(found.slope - line[0]) < 0.25 * std
    assert math.sqrt(found.slope_variance) == pytest.approx(std, rel=0.05)


def test_blocks_kept_by_an_earlier_version_are_weighed_once_and_go_on():
    """Format 2 of the state had all blocks of 16 cycles and no segments."""
    cycles = np.arange(1600)
    values = 0.2 + 1e-6 * cycles + STD * np.random.default_rng(8).normal(size=1600)
    means = values.reshape(-1, 16).mean(axis=1)
    blocks = np.column_stack(
        [np.full(100, 16.0), 16.0 * np.arange(100) + 7.5, means, np.full(100, SURELY_NONE)]
    )
    old = {
        "origin": 0.0,
        "mean": np.array([0.0, 0.2, 0.2]),
        "covariance": wear_blocks.begin(0, 0.2, 0.1).covariance,
        "blocks": blocks,
        "open_cycles": 16,
        "slopes": np.array([[1e-6, 0.5, 0.2, 1e-8], [2e-6, 0.5, 0.2, 1e-8]]),
        "weighed_blocks": 99,
    }
    from_format_2 = STATE_MIGRATIONS[1]
    migrated = from_format_2({"cell": {"tracker": {"wear_blocks": old}}})
    wear = wear_blocks.WearBlocks(**migrated["cell"]["tracker"]["wear_blocks"])
    wear = wear_blocks.update(wear_blocks.append(wear, 1600, 0.2016, 1.0, SURELY_NONE), MODEL)
    found = wear_blocks.moments(wear, 1600)
    line, spread = np.polyfit(cycles, values, 1, cov="unscaled")
    std = STD * math.sqrt(spread[0, 0])
    assert len(wear.blocks) == 1
    assert len(wear.segments) == len(wear_blocks.OFFSETS)
    assert abs(found.slope - line[0]) < 0.1 * std
    assert math.sqrt(found.slope_variance) == pytest.approx(std, rel=0.05)
    nothing = {"cell": {"tracker": {"wear_blocks": None}}}
    assert from_format_2(nothing) == nothing


def test_the_probability_is_that_of_the_mixture():
    slopes = np.array([[1e-6, 0.25, 0.20, 1e-8], [2e-6, 0.75, 0.21, 1e-8]])
    wear = replace(wear_blocks.begin(0, 0.2, 0.1), slopes=slopes)
    # levels at cycle 1000: 0.201 and 0.212, standard deviation 1e-4
    assert wear_blocks.probability_above(wear, 1000, 0.206) == pytest.approx(0.75)
    assert wear_blocks.probability_above(wear, 1000, 0.212) == pytest.approx(0.375)
    assert wear_blocks.moments(wear, 1000).level == pytest.approx(0.25 * 0.201 + 0.75 * 0.212)


def followed(state, values, first=0, settings=UNKNOWN, batch=None):
    for i, value in enumerate(values.tolist(), start=first):
        result = wear_batch.update(settings, state, FrictionObservation(i, value, STD, batch_id=batch))
        state = result.state
    return result


@pytest.mark.slow
def test_a_state_without_blocks_goes_on_from_what_its_bank_has_learned():
    """As that of an earlier version, which kept none."""
    values = 0.2 + 5e-6 * np.arange(600) + STD * np.random.default_rng(3).normal(size=600)
    before = followed(initial_state(), values[:450])
    old = replace(before.state, wear_blocks=None)
    after = followed(old, values[450:], first=450)
    whole = followed(before.state, values[450:], first=450)
    assert after.state.wear_blocks.slopes.size
    afresh = followed(initial_state(), values[450:])
    assert after.wear.rate_std < 0.5 * afresh.wear.rate_std
    assert after.wear.rate_std < 2.0 * whole.wear.rate_std
    assert abs(after.wear.level - whole.wear.level) < whole.wear.level_std


@pytest.mark.slow
def test_an_outlier_moves_nothing_and_a_late_cycle_is_left_out():
    values = 0.2 + STD * np.random.default_rng(4).normal(size=300)
    plain = followed(initial_state(), values)
    values[200] = 1.0
    odd = followed(initial_state(), values)
    assert abs(odd.wear.level - plain.wear.level) < 0.2 * plain.wear.level_std
    late = FrictionObservation(250, 0.2, STD)
    skipped = followed(initial_state(), values[:250])
    ahead = followed(skipped.state, values[251:], first=251)
    assert wear_batch.update(UNKNOWN, ahead.state, late).state.wear_blocks is ahead.state.wear_blocks


def test_blocks_are_kept_only_where_nobody_says_of_which_batch_a_cycle_is():
    values = 0.2 + STD * np.random.default_rng(5).normal(size=40)
    known = TrackerSettings(wear_limit=0.25)
    told = followed(initial_state(), values, settings=known, batch="A")
    assert told.state.wear_blocks is None
    untold = followed(told.state, values, first=40, settings=known)
    assert untold.state.wear_blocks is not None
    assert followed(untold.state, values, first=80, settings=known, batch="A").state.wear_blocks is None


@pytest.mark.parametrize("hazard", [1e-3, 0.4, 1.0])
@pytest.mark.parametrize("begun", [0.125, 1.0])
def test_a_change_that_may_have_been_takes_its_probability_from_that_of_none(hazard, begun):
    grid = np.array([0.0])
    wear = wear_blocks.WearBlocks(0.0, np.array([0.0, 0.2, 0.2]), np.diag([1e-10, 4.0, 4.0]))
    _, segments = wear_blocks.before_blocks(wear, grid, STD**2)
    present = np.empty(block_filter.ROOM, block_filter.SEGMENT)
    count = block_filter.copy_present(segments[0], present)
    count, old = block_filter.spawn(present, count, 8.0, hazard, begun)
    assert old == (0 if hazard == 1.0 else 1)
    changed = present[:count]["change"] == 8.0
    probability = present[:count]["probability"]
    assert probability.sum() == pytest.approx(1.0)
    assert probability[changed].sum() == pytest.approx(hazard)


SWINGING = """
import numpy as np, impactcell
from impactcell.tracking.wear_batch import walk_models
walk_models.CLEARLY = np.inf  # the blocks are to go on where a slope that walks would be believed
for seed in (2, 4):
    n = 6000
    swing = np.sin(2.0 * np.pi * np.arange(n) / 2000.0)
    mu_s = 0.2 + 0.002 * (np.random.default_rng([99, seed]).normal(size=n) + swing + 3.3e-4 * np.arange(n))
    wear = impactcell.track(np.arange(n), mu_s, np.full(n, 0.002)).wear
    print(wear.rate_per_cycle / 0.002, wear.rate_std / 0.002)
"""


@pytest.mark.slow
def test_a_level_that_swings_leaves_the_slopes_finite_and_near_in_memory_that_is_theirs(cache):
    """A segment without probability stood before others: all were dropped, and the next wrote past the end.

    By the compiler's own check of bounds, in a process of its own. Then slopes ran off along a level tail.
    """
    machine_code = cache.mkdir("bounds-checked")  # kept, as all other machine code is
    environment = {**os.environ, "NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(machine_code)}
    done = subprocess.run(
        [sys.executable, "-c", SWINGING], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    for line in done.stdout.splitlines():
        rate, std = map(float, line.split())
        assert abs(rate - 3.3e-4) < np.pi / 1000.0  # no steeper than the swing
        assert 0.0 < std < 2e-3
