"""What a series of block means says of one slope, with the batch changes between them averaged over.

Given the slope, batches share nothing but the level, and their changes can be averaged over forward along
the blocks (Fearnhead 2006, Stat. Comput. 16:203). Segments are records of `SEGMENT`, oldest change first;
functions change the first `count` in place. Each also has the derivatives by the slope of all it says, exact
for each history of changes, so that what is known at some slopes can be had at others without the blocks.
What is kept between cycles: `impactcell.tracking.wear_batch.wear_blocks`.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from impactcell.numerics.jit import compiled
from impactcell.records import Samples
from impactcell.tracking.wear_batch.run_length_model import STEPS

BLOCK = 8
"""Cycles of one block. A change inside one costs that block: with 16 the slope's error is 5 % larger."""
HAZARD = 1e-3
"""Prior probability of a change, a cycle: batches of a thousand. Where they are, three times as many put off
the alarm of a passed limit by 700 cycles: every small step that may have been may pass for wear."""
MOST_PROBABLE = 0.5
"""Prior probability of a change between two blocks, at most."""
SEGMENTS = 12
"""Hypotheses of the last change that are kept for one slope; 60 say the same to three digits."""
DROPPED = 1e-9
"""Probability below which one is given up."""
STEP_SCALES = np.array(
    [math.hypot(STEPS[0][0], STEPS[0][1]), math.hypot(STEPS[2][0], STEPS[2][1]), STEPS[4][1]]
)
"""Standard deviations of a step, middling, small and large: those of the bank, up and down together."""
STEP_SHARES = np.array([0.7, 0.2, 0.1])
"""Their probabilities. The bank gives small ones 0.44, to find them soon; believed of all the past, that many
would pass for wear."""

WEIGHT, CYCLE, VALUE, CHANGE = range(4)
"""Columns of a block: sum of its weights, weighted means of index and mu_s, and what is known of a change
just before it (see `UsableCycle.announced`)."""
SLOPE, LEVEL, TOTAL = range(3)
"""Order of what is known of the time before the blocks."""
SEGMENT = np.dtype(
    [
        ("probability", np.float64),
        ("change", np.float64),
        ("level", np.float64),
        ("total", np.float64),
        ("level_variance", np.float64),
        ("covariance", np.float64),
        ("total_variance", np.float64),
        ("level_by_slope", np.float64),
        ("total_by_slope", np.float64),
        ("log_by_slope", np.float64),
        ("log_curvature", np.float64),
    ]
)
"""When the last change was, given the slope, and what follows from it for level and total at the origin; then
the derivatives of both by the slope, and the first two of the logarithm of its evidence. One that is not in
use has the probability 0."""
WIDTH = SEGMENT.itemsize // 8
"""Numbers of one segment."""
Segments = NDArray[np.void]
"""Array of `SEGMENT`, shape (k,)."""
PARTS = np.array([1.0, 5.0 / 6.0, 0.5, 1.0 / 6.0])
"""Parts of a step that the block has in which it comes: all of it, and thirds of the block's cycles."""
ROOM = SEGMENTS + len(STEP_SCALES) * len(PARTS)
"""Segments that there can be before they are merged."""


class BlockModel(NamedTuple):
    """What is assumed of a series of blocks.

    Attributes
    ----------
    variance : float
        Of a usual estimate.
    step_variance : float
        Of the prior of a batch step.
    level_walk : float
        Variance a cycle of the random walk of the level.
    """

    variance: float
    step_variance: float
    level_walk: float


@compiled
def filter_slopes(
    grid: Samples, segments: Segments, blocks: Samples, origin: float, before: float, model: BlockModel
) -> Samples:
    """Take blocks into the segments of each slope, shape (j, SEGMENTS), in place; log evidence of each slope.

    `before` is the cycle of the last block that has been taken in.
    """
    evidence = np.empty(len(grid))
    present = np.empty(ROOM, SEGMENT)
    for j in range(len(grid)):
        count = copy_present(segments[j], present)
        evidence[j], count = filter_blocks(present, count, blocks, origin, before, grid[j], model)
        for i in range(count):
            segments[j, i] = present[i]
        for i in range(count, SEGMENTS):
            segments[j, i].probability = 0.0
    return evidence


@compiled
def copy_present(segments: Segments, into: Segments) -> int:
    """Copy the segments that are in use and say how many there are."""
    count = 0
    while count < len(segments) and segments[count].probability > 0.0:
        into[count] = segments[count]
        count += 1
    return count


@compiled
def levels(segments: Segments) -> Samples:
    """Mean and variance of the level at the origin given each slope, shape (j, 2)."""
    known = np.empty((len(segments), 2))
    present = np.empty(SEGMENTS, SEGMENT)
    for j in range(len(segments)):
        count = copy_present(segments[j], present)
        merge(present, 0, count)
        known[j, 0], known[j, 1] = present[0].level, present[0].level_variance
    return known


@compiled
def filter_blocks(
    segments: Segments,
    count: int,
    blocks: Samples,
    origin: float,
    before: float,
    slope: float,
    model: BlockModel,
) -> tuple[float, int]:
    """Take the blocks into the first `count` of `segments`; log evidence, and how many there are then."""
    evidence = 0.0
    for block in blocks:
        cycle = block[CYCLE]
        walk(segments, count, (cycle - before) * model.level_walk)
        hazard = min(HAZARD * (cycle - before), MOST_PROBABLE) if block[CHANGE] == 0.0 else 0.0
        if block[CHANGE] > 0.0:
            hazard = 1.0
        begun = 1.0 if block[CHANGE] > 0.0 else 1.0 / max(cycle - before, 1.0)
        old = count
        if hazard > 0.0:
            count, old = spawn(segments, count, cycle, hazard, begun)
        value = block[VALUE] - slope * (cycle - origin)
        observed = value, model.variance / block[WEIGHT], cycle - origin
        log_density, count = take(segments, count, observed, old, model.step_variance)
        evidence += log_density
        while count > SEGMENTS:
            closest, least = 0, np.inf
            for i in range(count - 1):
                older, newer = segments[i], segments[i + 1]
                apart = (newer.change - older.change + 0.5 * BLOCK) / (cycle - older.change + BLOCK)
                cost = apart * min(older.probability, newer.probability)
                if cost < least:
                    closest, least = i, cost
            merge(segments, closest, closest + 2)
            for i in range(closest + 1, count - 1):
                segments[i] = segments[i + 1]
            count -= 1
        before = cycle
    return evidence, count


@compiled
def walk(segments: Segments, count: int, variance: float) -> None:
    """Let the level have walked at random, and the friction of the batch with it."""
    for i in range(count):
        segment = segments[i]
        segment.level_variance += variance
        segment.covariance += variance
        segment.total_variance += variance


@compiled
def spawn(segments: Segments, count: int, cycle: float, hazard: float, begun: float) -> tuple[int, int]:
    """Add what follows if a change came with the block at `cycle`: each size of step, and part of it.

    `begun` is the share of those that came just before the block. Gives how many segments there are, and
    where the new ones begin, which `take` gives their step.
    """
    changed = np.empty(count, segments.dtype)
    for i in range(count):
        changed[i] = segments[i]
        segments[i].probability *= 1.0 - hazard
    merge(changed, 0, count)
    if hazard >= 1.0:
        count = 0
    old = count
    for k in range(len(STEP_SCALES)):
        for part in range(len(PARTS)):
            share = begun if part == 0 else (1.0 - begun) / (len(PARTS) - 1)
            segments[count] = changed[0]
            segments[count].probability = hazard * STEP_SHARES[k] * share
            segments[count].change = cycle
            count += 1
    return count, old


@compiled
def take(
    segments: Segments, count: int, observed: tuple[float, float, float], old: int, step_variance: float
) -> tuple[float, int]:
    """Update every segment with one value; log density of the value, and how many segments are left.

    Of what was `observed`, value, variance and cycles since the origin, the value falls by as much as the
    slope grows. From `old` on there is a step s, of which the value has a part f: total + f s + e, and the
    total becomes total + s. Those of one size are one afterwards, whatever the part was.
    """
    value, variance, passed = observed
    top = -np.inf
    exponents = np.empty(count)
    for i in range(count):
        segment = segments[i]
        step, part = 0.0, 0.0
        if i >= old:
            step = STEP_SCALES[(i - old) // len(PARTS)] ** 2 * step_variance
            part = PARTS[(i - old) % len(PARTS)]
        spread = segment.total_variance + part**2 * step + variance
        innovation = value - segment.total
        by_slope = -passed - segment.total_by_slope
        exponents[i] = -0.5 * innovation**2 / spread
        top = max(top, exponents[i])
        segment.probability /= math.sqrt(2.0 * math.pi * spread)
        gain = (segment.total_variance + part * step) / spread
        crossed = segment.covariance
        segment.log_by_slope -= by_slope * innovation / spread
        segment.log_curvature -= by_slope**2 / spread
        segment.level_by_slope += crossed / spread * by_slope
        segment.total_by_slope += gain * by_slope
        segment.level += crossed / spread * innovation
        segment.total += gain * innovation
        segment.level_variance -= crossed**2 / spread
        segment.covariance -= gain * crossed
        segment.total_variance += step - gain**2 * spread
    total = 0.0
    for i in range(count):
        segments[i].probability *= math.exp(exponents[i] - top)
        total += segments[i].probability
    for k in range((count - old) // len(PARTS)):
        first = old + k * len(PARTS)
        share = 0.0
        for i in range(first, first + len(PARTS)):
            share += segments[i].probability
        if share > 0.0:
            merge(segments, first, first + len(PARTS))
        segments[old + k] = segments[first]
    count = old + (count - old) // len(PARTS)
    kept = 0
    for i in range(count):
        segments[i].probability /= total
        if segments[i].probability > DROPPED:
            if kept != i:
                segments[kept] = segments[i]
            kept += 1
    return top + math.log(total), kept


@compiled
def merge(segments: Segments, first: int, last: int) -> None:
    """Merge segments first..last-1 by moments into the first of them; derivatives as of the mixture."""
    total = level = share = by_slope = 0.0
    heaviest = first
    for i in range(first, last):
        segment = segments[i]
        share += segment.probability
        level += segment.probability * segment.level
        total += segment.probability * segment.total
        by_slope += segment.probability * segment.log_by_slope
        if segment.probability > segments[heaviest].probability:
            heaviest = i
    level, total, by_slope = level / share, total / share, by_slope / share
    level_variance = covariance = total_variance = 0.0
    level_by_slope = total_by_slope = curvature = 0.0
    for i in range(first, last):
        segment = segments[i]
        part, a, b = segment.probability / share, segment.level - level, segment.total - total
        moved = segment.log_by_slope - by_slope
        level_variance += part * (segment.level_variance + a * a)
        covariance += part * (segment.covariance + a * b)
        total_variance += part * (segment.total_variance + b * b)
        level_by_slope += part * (segment.level_by_slope + moved * a)
        total_by_slope += part * (segment.total_by_slope + moved * b)
        curvature += part * (segment.log_curvature + moved * moved)
    change = segments[heaviest].change
    into = segments[first]
    into.probability, into.change, into.level, into.total = share, change, level, total
    into.level_variance, into.covariance, into.total_variance = level_variance, covariance, total_variance
    into.level_by_slope, into.total_by_slope = level_by_slope, total_by_slope
    into.log_by_slope, into.log_curvature = by_slope, curvature
