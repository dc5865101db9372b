"""Captures made small: means over short blocks of samples, fine where the model has kinks.

A tap has some ten numbers' worth of information and up to 24 000 samples. Between its events the motion is
smooth, so a mean over 0.1 ms of force is the force at the block's centre to 1 part in 70 000, far below
noise. About each event, where the slope jumps, blocks are as short as the samples allow.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.prediction.reading import noise_std
from impactcell.records import Channel, Samples

FORCE_BLOCK_S = 1e-4
FINE_FORCE_BLOCK_S = 1e-5
POSITION_BLOCK_S = 2.5e-4
FINE_POSITION_BLOCK_S = 5e-5


@dataclass(frozen=True, slots=True, eq=False)
class Blocks:
    """Means of consecutive samples of one channel.

    Attributes
    ----------
    time_s, values, std : ndarray, shape (n,)
        Mean time, mean value, and its standard deviation from the noise of one sample.
    """

    time_s: Samples
    values: Samples
    std: Samples


NOTHING = Blocks(np.empty(0), np.empty(0), np.empty(0))


def blocks(
    channel: Channel,
    coarse_s: float,
    fine_s: float,
    fine: Sequence[tuple[float, float]],
    edges: Sequence[float] = (),
    until_s: float = np.inf,
) -> Blocks:
    """Average a channel over blocks.

    Parameters
    ----------
    channel : Channel
    coarse_s, fine_s : float
        Longest block, and the longest within the spans of `fine`.
    fine : sequence of (float, float)
        Spans of time, s, in which the model may have a kink.
    edges : sequence of float
        Times no block may straddle: known jumps.
    until_s : float
        Samples after this are left out.
    """
    times = channel.time_s
    count = len(times) if until_s >= times[-1] else int(np.searchsorted(times, until_s, "right"))
    if count == 0:
        return NOTHING
    times, values = times[:count], channel.values[:count]
    end = float(times[-1])
    pieces = [np.arange(min(0.0, float(times[0])), end + coarse_s, coarse_s)]
    for first, last in fine:
        low, high = max(first, float(times[0]) - fine_s), min(last, end + fine_s)
        if high > low:
            pieces.append(np.arange(low, high + fine_s, fine_s))
    pieces.append(np.asarray(edges, dtype=np.float64))
    limits = np.unique(np.concatenate(pieces))
    starts = np.unique(np.searchsorted(times, limits, "left"))
    starts = starts[starts < count]
    if len(starts) == 0 or starts[0] != 0:
        starts = np.concatenate([[0], starts])
    sizes = np.diff(np.append(starts, count))
    sigma = noise_std(channel)
    return Blocks(
        np.add.reduceat(times, starts) / sizes,
        np.add.reduceat(values, starts) / sizes,
        sigma / np.sqrt(sizes),
    )
