"""Wear from all cycles at once: for each of a few slopes, with the batch changes averaged over.

The bank of run lengths has one Gaussian for all pasts of a hypothesis. A step of a few tenths of a standard
deviation looks like wear for many cycles, and when the next batch comes the bank keeps the mean of both
stories, though later cycles could have told them apart. So the cycles are kept, as means of `BLOCK` of them,
each an observation of the friction of its batch::

    z_k = level + slope (t_k - t_0) + offset + e_k,   offset steps with the hazard of a change

and the evidence of each slope is what all of them say of it (`impactcell.tracking.wear_batch.block_filter`).
What is older than the blocks is kept as a Gaussian of slope, level and total.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import ndtr

from impactcell.numerics.jit import compiled
from impactcell.records import Samples
from impactcell.tracking.wear_batch.block_filter import (
    BLOCK,
    CHANGE,
    CYCLE,
    LEVEL,
    SLOPE,
    TOTAL,
    VALUE,
    WEIGHT,
    BlockModel,
    filter_slopes,
)
from impactcell.tracking.wear_batch.wear_report import WearMoments

MOST_BLOCKS = 200
"""Closed blocks that are kept; neighbours of one batch are put together to make room."""
RECENT_BLOCKS = 64
"""The newest blocks, which are left as they are."""
LONGEST = 200.0
"""Cycles at which the length of a block weighs against putting it together as much as a standard deviation
between the two."""
MOST_CYCLES = 30_000.0
"""Span of the blocks; then the older half becomes a Gaussian."""
FEWEST_BLOCKS = 6
"""Blocks before which the bank says as much."""
RENEWED = 128
"""The posterior is renewed whenever the blocks have grown by one part in so many."""
FIRST_SLOPE_STD = 0.02
"""Half width of the first grid is `SPAN` times this, standard deviations of one estimate a cycle."""
SLOPES = 11
"""Slopes that are weighed at a time."""
SPAN = 4.0
"""How far they reach, in standard deviations on either side."""
WIDENED = 1.2
"""Factor of the last standard deviation from which the next grid is made."""
EDGE = 1e-3
"""Probability of an outermost slope at which the grid is laid again."""
WIDEST_SPACING = 1.3
"""Spacing of the grid, in standard deviations of the slope, beyond which it is laid again."""
MOST_GRIDS = 6
"""Grids that are tried; the first is good enough nearly always."""
DIFFUSE = 100.0
"""Standard deviation of the level before any block, in standard deviations of one estimate."""


@dataclass(frozen=True, slots=True, eq=False)
class WearBlocks:
    """The cycles so far, and what they say of the slope.

    Attributes
    ----------
    origin : float
        Index at which level and total are meant.
    mean, covariance : ndarray, shapes (3,) and (3, 3)
        Slope, level and total before the blocks; the covariance over the variance of a usual estimate, which
        may still be learned.
    blocks : ndarray, shape (n, 4)
        Oldest first; the last one is still open.
    open_cycles : int
        Cycles in it.
    slopes : ndarray, shape (j, 4)
        Posterior: slope, its probability, mean and variance of the level at the origin given it; empty before
        the first.
    weighed_blocks : int
        Closed blocks that it rests on.
    """

    origin: float
    mean: Samples
    covariance: Samples
    blocks: Samples = field(default_factory=lambda: np.zeros((0, 4)))
    open_cycles: int = 0
    slopes: Samples = field(default_factory=lambda: np.zeros((0, 4)))
    weighed_blocks: int = 0


def begin(index: int, value: float, slope_std: float) -> WearBlocks:
    """Begin at the first cycle, before it is taken in: total and level are the same, and not known yet.

    Parameters
    ----------
    slope_std : float
        Prior standard deviation of the slope, in standard deviations of one estimate.
    """
    covariance = np.full((3, 3), DIFFUSE**2)
    covariance[SLOPE] = covariance[:, SLOPE] = 0.0
    covariance[SLOPE, SLOPE] = slope_std**2
    return WearBlocks(float(index), np.array([0.0, value, value]), covariance)


def continue_from(index: int, mean: Samples, covariance: Samples, variance: float) -> WearBlocks:
    """Begin with what is known of slope, level and total after a cycle; `variance` of a usual estimate."""
    return WearBlocks(float(index), mean, covariance / variance)


def append(wear: WearBlocks, index: int, value: float, weight: float, change: float) -> WearBlocks:
    """Take in one cycle.

    Parameters
    ----------
    weight : float
        Of the estimate, 1 for a usual one.
    change : float
        What is known of a batch change just before it.
    """
    if len(wear.blocks) == 0 or wear.open_cycles >= BLOCK or change > 0.0:
        opened = np.array([[weight, float(index), value, change]])
        return replace(wear, blocks=np.vstack([wear.blocks, opened]), open_cycles=1)
    blocks = wear.blocks.copy()
    block = blocks[-1]
    share = weight / (block[WEIGHT] + weight)
    block[WEIGHT] += weight
    block[CYCLE] += share * (index - block[CYCLE])
    block[VALUE] += share * (value - block[VALUE])
    return replace(wear, blocks=blocks, open_cycles=wear.open_cycles + 1)


def update(wear: WearBlocks, model: BlockModel) -> WearBlocks:
    """Renew the posterior where the blocks have grown enough since the last time."""
    closed = len(wear.blocks) - 1
    if wear.open_cycles > 1 or closed < FEWEST_BLOCKS:
        return wear
    if len(wear.slopes):
        wear = _condensed(wear, model)
        closed = len(wear.blocks) - 1
        if RENEWED * (closed - wear.weighed_blocks) < closed:
            return wear
        around = _moments(wear.slopes[:, 0], wear.slopes[:, 1])
    else:
        unit = math.sqrt(model.variance)
        prior = unit * math.sqrt(wear.covariance[SLOPE, SLOPE])
        around = float(wear.mean[SLOPE]), min(FIRST_SLOPE_STD * unit, prior)
    weighed = _weigh(wear, wear.blocks[:closed], model, (around[0], WIDENED * around[1]))
    return replace(wear, slopes=weighed[:, :4].copy(), weighed_blocks=closed)


def moments(wear: WearBlocks, index: int) -> WearMoments:
    """Level and slope at a cycle, by the last posterior."""
    return WearMoments(*_moments_after(wear.slopes, index - wear.origin))


@compiled
def _moments_after(slopes: Samples, passed: float) -> tuple[float, float, float, float, float]:
    """Moments of the mixture over the slopes, after so many cycles; as `WearMoments`."""
    mean = centre = variance = covariance = slope_variance = 0.0
    for row in slopes:
        mean += row[1] * (row[2] + row[0] * passed)
        centre += row[1] * row[0]
    for row in slopes:
        apart, beside = row[2] + row[0] * passed - mean, row[0] - centre
        variance += row[1] * (row[3] + apart**2)
        covariance += row[1] * apart * beside
        slope_variance += row[1] * beside**2
    return mean, centre, variance, covariance, slope_variance


def probability_above(wear: WearBlocks, index: int, limit: float) -> float:
    """P(level > limit) at a cycle: the mean over the slopes, which no single normal distribution gives."""
    slope, share, level, variance = wear.slopes.T
    level = level + slope * (index - wear.origin)
    return float(share @ ndtr((level - limit) / np.sqrt(variance)))


def _condensed(wear: WearBlocks, model: BlockModel) -> WearBlocks:
    """Make room for the block that was just opened: the cost of a cycle stays bounded."""
    if wear.blocks[-1, CYCLE] - wear.origin > MOST_CYCLES:
        return _shortened(wear, model)
    if len(wear.blocks) <= MOST_BLOCKS + 1:
        return wear
    if np.all(wear.blocks[1:-RECENT_BLOCKS, CHANGE] > 0.0):
        return _shortened(wear, model)  # no two neighbours are of one batch
    slope, _ = _moments(wear.slopes[:, 0], wear.slopes[:, 1])
    blocks = _merged_neighbours(wear.blocks, slope, model.variance)
    return replace(wear, blocks=blocks, weighed_blocks=max(wear.weighed_blocks - 1, 0))


def _merged_neighbours(blocks: Samples, slope: float, variance: float) -> Samples:
    """Put together the two neighbours that are most likely of one batch and shortest."""
    weight, cycle, value, change = blocks[:-RECENT_BLOCKS].T
    apart = np.diff(value) - slope * np.diff(cycle)
    lengths = np.append(np.diff(cycle), BLOCK)
    cost = apart**2 / (variance / weight[1:] + variance / weight[:-1])
    cost += ((lengths[1:] + lengths[:-1]) / LONGEST) ** 2
    cost[change[1:] > 0.0] = np.inf
    k = int(np.argmin(cost))
    total = weight[k] + weight[k + 1]
    share = weight[k + 1] / total
    merged = blocks[k].copy()
    merged[WEIGHT] = total
    merged[CYCLE] += share * (cycle[k + 1] - cycle[k])
    merged[VALUE] += share * (value[k + 1] - value[k])
    return np.vstack([blocks[:k], merged, blocks[k + 2 :]])


def _shortened(wear: WearBlocks, model: BlockModel) -> WearBlocks:
    """Make the older half of the blocks a Gaussian of slope, level and total at its end."""
    half = (len(wear.blocks) - 1) // 2
    centre, std = _moments(wear.slopes[:, 0], wear.slopes[:, 1])
    older = _weigh(wear, wear.blocks[:half], model, (centre, 2.0 * std))
    slope, share, level, level_variance, total, covariance, total_variance = older.T
    passed = wear.blocks[half - 1, CYCLE] - wear.origin
    values = np.array([slope, level + slope * passed, total + slope * passed])
    mean = values @ share
    apart = values - mean[:, None]
    spread = (share * apart) @ apart.T
    spread[LEVEL, LEVEL] += share @ level_variance
    spread[TOTAL, TOTAL] += share @ total_variance
    spread[LEVEL, TOTAL] += share @ covariance
    spread[TOTAL, LEVEL] += share @ covariance
    moved = wear.slopes.copy()
    moved[:, 2] += moved[:, 0] * passed
    return replace(
        wear,
        origin=wear.origin + passed,
        mean=mean,
        covariance=spread / model.variance,
        blocks=wear.blocks[half:],
        slopes=moved,
        weighed_blocks=max(wear.weighed_blocks - half, 0),
    )


def _weigh(wear: WearBlocks, blocks: Samples, model: BlockModel, around: tuple[float, float]) -> Samples:
    """Weigh a grid of slopes, shape (j, 7): `WearBlocks.slopes`, then total, covariance, total variance."""
    slope, std = around
    covariance = model.variance * wear.covariance
    weighed = np.empty((SLOPES, 7))
    for _ in range(MOST_GRIDS):
        grid = slope + std * np.linspace(-SPAN, SPAN, SLOPES)
        evidence = filter_slopes(grid, blocks, wear.origin, wear.mean, covariance, model, weighed)
        evidence = evidence - 0.5 * (grid - wear.mean[SLOPE]) ** 2 / covariance[SLOPE, SLOPE]
        share = np.exp(evidence - evidence.max())
        share /= share.sum()
        spacing = grid[1] - grid[0]
        slope, std = _moments(grid, share)
        weighed[:, 0], weighed[:, 1] = grid, share
        if max(share[0], share[-1]) < EDGE and spacing < WIDEST_SPACING * std:
            break
        std = max(std, 0.5 * spacing)
    return weighed


def _moments(values: Samples, shares: Samples) -> tuple[float, float]:
    mean = float(shares @ values)
    return mean, math.sqrt(float(shares @ (values - mean) ** 2))
