"""Stretches of a record in which a channel shows nothing: without samples, or at an end of its range."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from impactcell.discrepancy.machine.records.channel_values import ABOUT
from impactcell.discrepancy.machine.terms.base_model import NumberPrior
from impactcell.quality import ends_of_range, gaps_in_time
from impactcell.records import Channel, Samples

MAX_DIP = 5
"""Samples between two at an end of the range that only noise has brought off it."""
MOST_CLIPPED = 0.25
"""Share of a record in which a force stands at an end of its range, from which on that is the drive's own
limit, as of a controller that goes to it at each step: no recorder is left so narrow [1]."""
Gaps = tuple[tuple[float, float], ...]
"""Begin and end of each stretch of time within which a channel shows nothing [s], in their order."""


def clipped_samples(name: str, channel: Channel) -> NDArray[np.bool_]:
    """Whether each sample stands at an end at which the channel is clipped, shape (n,)."""
    clipped: NDArray[np.bool_] = np.isin(channel.values, ends_of_range(name, channel))
    for first, last in pairwise(np.flatnonzero(clipped).tolist()):
        if last - first <= MAX_DIP + 1:
            clipped[first:last] = True
    return clipped


def sound_neighbours(times: Samples, clipped: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Places of the samples before and after each stretch without any that is sound, shape (m, 2).

    -1 and the number of samples where the record begins or ends in such a stretch.

    Examples
    --------
    >>> times = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 30.0, 31.0])
    >>> sound_neighbours(times, np.array([False, False, True, True, False, False, False, True])).tolist()
    [[1, 4], [5, 6], [6, 8]]
    """
    sound = np.concatenate([[-1], np.flatnonzero(~clipped), [len(times)]])
    apart = (np.diff(sound) > 1) | np.isin(sound[:-1], gaps_in_time(times))
    neighbours: NDArray[np.int64] = np.stack([sound[:-1], sound[1:]], axis=1)[apart]
    return neighbours


def as_it_was_beside(
    neighbours: NDArray[np.int64], channel: Channel, cleaned: Samples, replaced: int
) -> tuple[Samples, int]:
    """Take back what was replaced beside such a stretch: a motion that goes on looks like an outlier."""
    if not neighbours.size:
        return cleaned, replaced
    for before, after in neighbours.tolist():
        beside = slice(max(before + 1 - ABOUT, 0), after + ABOUT)
        cleaned[beside] = channel.values[beside]
    return cleaned, int(np.count_nonzero(cleaned != channel.values))


def gaps_of(
    channels: Sequence[Channel],
    neighbours: Sequence[NDArray[np.int64]],
    delay: NumberPrior,
    begin_s: float,
) -> Gaps:
    """Where position or force show nothing: the force, however late it may have been recorded."""
    found = []
    for channel, around, (early_s, late_s) in zip(
        channels, neighbours, ((0.0, 0.0), delay.reach), strict=False
    ):
        time = channel.time_s
        time = np.concatenate([[2.0 * time[0] - time[1]], time, [2.0 * time[-1] - time[-2]]]) - begin_s
        found += [(float(time[low + 1]) - late_s, float(time[high + 1]) - early_s) for low, high in around]
    gaps: list[tuple[float, float]] = []
    for low, high in sorted(found):
        if gaps and low <= gaps[-1][1]:
            gaps[-1] = gaps[-1][0], max(gaps[-1][1], high)
        else:
            gaps.append((low, high))
    return tuple(gaps)
