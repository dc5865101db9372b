"""Captures made small: means over short blocks of samples, fine where the model has kinks.

A tap has some ten numbers' worth of information and up to 24 000 samples. Between its events the motion is
smooth, so a mean over 0.1 ms of force is the force at the block's centre to 1 part in 70 000, and the rest is
the bend of the model there (`block_residuals.add_bends`). About each event, where the slope jumps,
blocks are as short as the samples allow.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.features import CheckedChannel
from impactcell.numerics.jit import compiled
from impactcell.prediction.whitening import within_block_std
from impactcell.records import CorrelatedNoise, Samples

FORCE_BLOCK_S, FINE_FORCE_BLOCK_S = 1e-4, 1e-5
"""Longest block of force, s, and about an event: there its bend costs less than the noise (see above)."""
POSITION_BLOCK_S, FINE_POSITION_BLOCK_S = 2.5e-4, 5e-5
"""The same of position, which bends less."""
FEW_SAMPLES = 3
"""Samples, those of 10 kHz, in whose mean the bend of a block is a thirtieth of the noise and is not counted.
Of 250 samples, at 1 MHz, it is a quarter, of one sign in all of the contact: mu_s was off by its std."""


@dataclass(frozen=True, slots=True, eq=False)
class WithinBlockSums:
    """How the samples of each block lie about its means.

    Attributes
    ----------
    count : ndarray, shape (n,)
        Samples of the block.
    times, values, both : ndarray, shape (n,)
        Sums of (t - mean t)², (y - mean y)² and of their product.
    noise_std : float
        Of one sample.
    """

    count: Samples
    times: Samples
    values: Samples
    both: Samples
    noise_std: float

    @property
    def spread(self) -> Samples:
        """Variance of the samples' times [s²], shape (n,); 0 where they are too few for a bend to show."""
        return np.where(self.count > FEW_SAMPLES, self.times / self.count, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class BlockMeans:
    """Means of consecutive samples of one channel.

    Attributes
    ----------
    time_s, values, std : ndarray, shape (n,)
        Mean time, mean value, and its standard deviation from the noise of one sample.
    scatter : WithinBlockSums
        What the means leave out.
    noise : CorrelatedNoise or None
        What neighbouring samples share of their noise; `std` is then that of samples within a block alone.
    """

    time_s: Samples
    values: Samples
    std: Samples
    scatter: WithinBlockSums
    noise: CorrelatedNoise | None = None


def average_blocks(
    channel: CheckedChannel,
    coarse_s: float,
    fine_s: float,
    fine: Sequence[tuple[float, float]],
    edges: Sequence[float] = (),
) -> BlockMeans:
    """Average a channel over blocks.

    Parameters
    ----------
    channel : CheckedChannel
    coarse_s, fine_s : float
        Longest block, and the longest within the spans of `fine`.
    fine : sequence of (float, float)
        Spans of time, s, in which the model may have a kink.
    edges : sequence of float
        Times no block may straddle: known jumps.
    """
    times, values = channel.time_s, channel.values
    begin, end = float(times[0]), float(times[-1])
    rulers = [_ruler(min(0.0, begin), end + coarse_s, coarse_s)]
    for first, last in fine:
        low, high = max(first, begin - fine_s), min(last, end + fine_s)
        if high > low:
            rulers.append(_ruler(low, high + fine_s, fine_s))
    rulers += [(edge, 0.0, 1.0) for edge in edges]
    noise = channel.shared_noise
    sigma = channel.sigma if noise is None else within_block_std(noise, coarse_s)
    table = _average(times, values, np.array(rulers), sigma)
    return BlockMeans(
        table[1], table[2], table[6], WithinBlockSums(table[0], table[3], table[4], table[5], sigma), noise
    )


def _ruler(start: float, stop: float, step: float) -> tuple[float, float, float]:
    """First mark, distance and number of the marks that `numpy.arange` makes."""
    return start, (start + step) - start, math.ceil((stop - start) / step)


@compiled
def _average(times: Samples, values: Samples, rulers: Samples, sigma: float) -> Samples:
    """Count, means, sums about the means and standard deviation of each block with samples, shape (7, n).

    A block begins with the first sample and at each mark of the `rulers`, shape (m, 3).
    """
    table = np.zeros((7, 1 + int(np.sum(rulers[:, 2]))))
    mark = np.zeros(len(rulers))
    block, end = 0, 0
    while end < len(times):
        first, until = end, np.inf
        for k in range(len(rulers)):
            start, step, count = rulers[k]
            while mark[k] < count and start + mark[k] * step <= times[first]:
                mark[k] += 1.0
            if mark[k] < count:
                until = min(until, start + mark[k] * step)
        t0, y0 = times[first], values[first]  # sums of what is left keep their digits
        t, y, tt, yy, ty = 0.0, 0.0, 0.0, 0.0, 0.0
        while end < len(times) and times[end] < until:
            dt, dy = times[end] - t0, values[end] - y0
            t += dt
            y += dy
            tt += dt * dt
            yy += dy * dy
            ty += dt * dy
            end += 1
        size = end - first
        table[0, block] = size
        table[1, block] = t0 + t / size
        table[2, block] = y0 + y / size
        table[3, block] = tt - t * t / size
        table[4, block] = yy - y * y / size
        table[5, block] = ty - t * y / size
        table[6, block] = sigma / math.sqrt(size)
        block += 1
    return table[:, :block].copy()
