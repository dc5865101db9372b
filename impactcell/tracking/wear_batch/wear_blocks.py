"""Wear from all cycles at once: for each of a few slopes, with the batch changes averaged over.

The bank of run lengths has one Gaussian for all pasts of a hypothesis. A step of a few tenths of a standard
deviation looks like wear for many cycles, and when the next batch comes the bank keeps the mean of both
stories, though later cycles could have told them apart. So the cycles are taken as means of `BLOCK` of them,
each an observation of the friction of its batch::

    z_k = level + slope (t_k - t_0) + offset + e_k,   offset steps with the hazard of a change

and go forward through a filter for each slope (`impactcell.tracking.wear_batch.block_filter`). While the
scale of the noise is being learned the blocks are kept and all are taken in anew; then one by one, and
forgotten.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import ndtr

from impactcell.numerics.jit import compiled
from impactcell.records import Samples
from impactcell.tracking.wear_batch.block_filter import (
    BLOCK,
    CYCLE,
    LEVEL,
    SEGMENT,
    SEGMENTS,
    SLOPE,
    TOTAL,
    VALUE,
    WEIGHT,
    WIDTH,
    BlockModel,
    Segments,
    filter_slopes,
    levels,
)
from impactcell.tracking.wear_batch.slope_grid import relay
from impactcell.tracking.wear_batch.wear_report import WearMoments

KEPT_BLOCKS = 71
"""Closed blocks that are kept and weighed again with every new one: the cycles of commissioning."""
FEWEST_BLOCKS = 19
"""Blocks before which the bank says as much: some hundred cycles."""
FIRST_SLOPE_STD = 0.02
"""Standard deviation from which the first grid is made, standard deviations of one estimate a cycle."""
OFFSETS = np.array(
    [-9.0, -6.5, -4.8, -3.6, -2.8, -2.1, -1.4, -0.7, 0.0, 0.7, 1.4, 2.1, 2.8, 3.6, 4.8, 6.5, 9.0]
)
"""Slopes that are weighed at a time, in standard deviations from the mean: far out there may be a slope with
a batch change more, which later cycles prove right."""
WIDENED = 1.2
"""Factor of the last standard deviation from which the next grid is made."""
TAIL = 2.0
"""Standard deviation beyond the ends of the grid, where nothing was seen, in those of the posterior."""
EDGE = 1e-3
"""Probability of an outermost slope at which the grid is laid again."""
MOVED = 1e-2
"""The same where the blocks are gone: what is known at a slope beyond is less sure than what is lost."""
WIDEST_SPACING = 1.0
"""Spacing in the middle of the grid, in standard deviations of the slope, beyond which it is laid again."""
MOST_GRIDS = 6
"""Grids that are tried; the first is good enough nearly always."""
SMALLEST_SHARE = 1e-300
"""Probability of a slope below which its logarithm is not followed."""
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
        Those that may be weighed again, oldest first; the last one is still open.
    open_cycles : int
        Cycles in it.
    slopes : ndarray, shape (j, 4)
        Posterior: slope, its probability, mean and variance of the level at the origin given it; empty before
        the first.
    segments : ndarray, shape (j, SEGMENTS, WIDTH)
        Of each slope, after the blocks that are no longer kept, see `block_filter.SEGMENT`; empty while all
        are.
    weighed_until : float
        Cycle of the last of those blocks.
    """

    origin: float
    mean: Samples
    covariance: Samples
    blocks: Samples = field(default_factory=lambda: np.zeros((0, 4)))
    open_cycles: int = 0
    slopes: Samples = field(default_factory=lambda: np.zeros((0, 4)))
    segments: Samples = field(default_factory=lambda: np.zeros((0, SEGMENTS, WIDTH)))
    weighed_until: float = 0.0


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
    # a change inside a block costs that block; the first cycles are the reference, and stand each by itself
    size = 1 if index - wear.origin <= BLOCK and not len(wear.segments) else BLOCK
    if len(wear.blocks) == 0 or wear.open_cycles >= size or change > 0.0:
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
    """Renew the posterior where a block has been closed."""
    closed = len(wear.blocks) - 1
    if wear.open_cycles > 1 or closed < 1:
        return wear
    if len(wear.segments):
        grid = wear.slopes[:, 0]
        evidence = np.log(np.maximum(wear.slopes[:, 1], SMALLEST_SHARE) / _ranges(grid))
        segments = _records(wear.segments.copy())
        blocks, before = wear.blocks[:closed], wear.weighed_until
        # in one piece, as in the first grids: one machine code serves both
        evidence += filter_slopes(grid.copy(), segments, blocks, wear.origin, before, model)
        return _renewed(wear, closed, *_relaid(grid, evidence, segments))
    if closed < FEWEST_BLOCKS and not len(wear.slopes):
        return wear
    if len(wear.slopes):
        around = _moments(wear.slopes[:, 0], wear.slopes[:, 1])
    else:
        unit = math.sqrt(model.variance)
        prior = unit * math.sqrt(wear.covariance[SLOPE, SLOPE])
        around = float(wear.mean[SLOPE]), min(FIRST_SLOPE_STD * unit, prior)
    weighed = _weigh(wear, wear.blocks[:closed], model, (around[0], WIDENED * around[1]))
    if closed < KEPT_BLOCKS:
        return replace(wear, slopes=_posterior(*weighed))
    return _renewed(wear, closed, *weighed)


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


def _renewed(
    wear: WearBlocks, closed: int, grid: Samples, evidence: Samples, segments: Segments
) -> WearBlocks:
    """Forget the blocks that have been taken in."""
    return replace(
        wear,
        blocks=wear.blocks[closed:],
        slopes=_posterior(grid, evidence, segments),
        segments=segments.view(np.float64).reshape(*segments.shape, WIDTH),
        weighed_until=float(wear.blocks[closed - 1, CYCLE]),
    )


def _relaid(grid: Samples, evidence: Samples, segments: Segments) -> tuple[Samples, Samples, Segments]:
    """Lay the grid again where it has become too coarse, or the posterior has moved to its end."""
    share = _shares(grid, evidence)
    slope, std = _moments(grid, share)
    spacing = _spacing(grid)
    if max(share[0], share[-1]) < MOVED and spacing < WIDEST_SPACING * std:
        return grid, evidence, segments
    onto = slope + WIDENED * max(std, 0.5 * spacing) * OFFSETS
    nearest = np.abs(grid - onto[:, None]).argmin(axis=1)
    moved = np.zeros_like(segments)
    gained = relay(grid.copy(), segments, onto, moved, (slope, TAIL * max(std, 0.5 * spacing)))
    return onto, evidence[nearest] + gained, moved


def _weigh(
    wear: WearBlocks, blocks: Samples, model: BlockModel, around: tuple[float, float]
) -> tuple[Samples, Samples, Segments]:
    """Weigh a grid of slopes by all blocks: the slopes, the log evidence and the segments of each."""
    slope, std = around
    for _ in range(MOST_GRIDS):
        grid = slope + std * OFFSETS
        evidence, segments = before_blocks(wear, grid, model.variance)
        evidence = evidence + filter_slopes(grid, segments, blocks, wear.origin, wear.origin, model)
        share = _shares(grid, evidence)
        spacing = _spacing(grid)
        slope, std = _moments(grid, share)
        if max(share[0], share[-1]) < EDGE and spacing < WIDEST_SPACING * std:
            break
        std = max(std, 0.5 * spacing)
    return grid, evidence, segments


def before_blocks(wear: WearBlocks, grid: Samples, variance: float) -> tuple[Samples, Segments]:
    """Log density of each slope before any block, and what is known of level and total given it."""
    covariance = variance * wear.covariance
    apart, spread = grid - wear.mean[SLOPE], covariance[SLOPE, SLOPE]
    by_slope = covariance[:, SLOPE] / spread
    given = covariance - np.outer(by_slope, covariance[SLOPE])
    segments = _records(np.zeros((len(grid), SEGMENTS, WIDTH)))
    first = segments[:, 0]
    first["probability"], first["change"] = 1.0, wear.origin
    first["level"] = wear.mean[LEVEL] + by_slope[LEVEL] * apart
    first["total"] = wear.mean[TOTAL] + by_slope[TOTAL] * apart
    first["level_variance"], first["total_variance"] = given[LEVEL, LEVEL], given[TOTAL, TOTAL]
    first["covariance"] = given[LEVEL, TOTAL]
    first["level_by_slope"], first["total_by_slope"] = by_slope[LEVEL], by_slope[TOTAL]
    first["log_by_slope"], first["log_curvature"] = -apart / spread, -1.0 / spread
    return -0.5 * apart**2 / spread, segments


def _posterior(grid: Samples, evidence: Samples, segments: Segments) -> Samples:
    """Give `WearBlocks.slopes`."""
    return np.column_stack([grid, _shares(grid, evidence), levels(segments)])


def _records(numbers: Samples) -> Segments:
    return numbers.view(SEGMENT)[..., 0]


def _spacing(grid: Samples) -> float:
    middle = len(grid) // 2
    return float(grid[middle] - grid[middle - 1])


def _ranges(grid: Samples) -> Samples:
    """Width of the range that each slope stands for: half way to its neighbours, at the ends a whole way."""
    widths = np.empty(len(grid))
    widths[0], widths[-1] = grid[1] - grid[0], grid[-1] - grid[-2]
    widths[1:-1] = (grid[2:] - grid[:-2]) / 2.0
    return widths


def _shares(grid: Samples, evidence: Samples) -> Samples:
    """Probability of each slope: of the range that it stands for."""
    share: Samples = np.exp(evidence - evidence.max()) * _ranges(grid)
    share /= share.sum()
    return share


def _moments(values: Samples, shares: Samples) -> tuple[float, float]:
    mean = float(shares @ values)
    return mean, math.sqrt(float(shares @ (values - mean) ** 2))
