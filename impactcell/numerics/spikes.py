"""Noise of a channel by its neighbours, and samples that are neither noise nor motion."""

import math

import numpy as np
from numpy.typing import NDArray

from impactcell.numerics.jit import compiled
from impactcell.numerics.local_polynomial import median
from impactcell.records import Samples

NORMAL_SCALE = 1.4826
"""Standard deviation over median absolute deviation of a normal distribution."""
SPIKE_STD = 12.0
"""Distance of a spike from the median of five samples, in standard deviations of the noise: white noise gets
there once in 1e30 samples."""
SPIKE_SHARE = 2e-3
"""The same as a share of the range: where there is no noise, a kink is that far from the median of its
neighbours."""
RASTER_STEPS = 3.0
"""The same in steps of a coarse raster, over which noise jumps by one or two."""
BENDS = 3.0
"""The same in second differences of the samples beside it."""
MAX_SPIKE_SAMPLES = 2
"""Samples in a row that are a spike; more is a motion, or a median of five would not see them."""
MAX_STEP = 0.5
"""Step between the two sides, over the height of a spike: a sample between two jumps is none."""
MARGIN = 4
"""Samples on either side by which a spike is told from what the signal does."""
MIN_SAMPLES = 16
"""Samples of a channel from which on any of this can be told."""
MAX_LOOKED_AT = 1000
"""Samples by which it is told whether there may be a spike at all."""


def noise_of(values: Samples) -> float:
    """Give the standard deviation of the white noise that a channel shows, from second differences; or 0.

    The median of their magnitude is that of the noise where less than half of the samples lie on a kink; the
    second difference of white noise has a variance of 6. It is 0 where most neighbours go on as before: of a
    channel without noise, and of one whose raster hides it. `white_noise_std` of the features is what a fit
    weighs by, and never below what a raster makes; here a threshold stands beside shares of the range and
    steps of the raster, and that there is no noise decides by itself (an exact record rests on a plateau).
    """
    return _noise_by_bends(np.abs(np.diff(values, 2))) if len(values) >= 5 else 0.0


def spike_samples(values: Samples) -> NDArray[np.intp]:
    """Give the indices of samples that are a spike: one or two in a row, far from what both sides go on to.

    A spike is far from the median of five samples, under which an edge stays where it is; from the lines
    through the two samples before and the two after it, of which an edge, a kink and the last sample before a
    jump are on one; by more than the signal bends beside it, as a pulse of few samples does; and from two
    sides that go on from each other, as those of a sample between two jumps do not.
    """
    none = np.empty(0, dtype=np.intp)
    if len(values) < MIN_SAMPLES:
        return none
    apart = max((len(values) - 2) // MAX_LOOKED_AT, 1)
    after, here, before = values[2::apart], values[1:-1:apart], values[:-2:apart]
    least_height = 0.5 * SPIKE_STD * _noise_by_bends(np.abs((after - here) - (here - before)))
    near = _standing_out(values, least_height)
    if not near.size:
        return none
    steps = np.abs(np.diff(values))
    raster = float(steps[steps > 0.0].min())
    least = max(SPIKE_STD * noise_of(values), SPIKE_SHARE * float(np.ptp(values)), RASTER_STEPS * raster)
    found = [
        near[_are_spikes(values, near, width, least)] + i
        for width in range(1, MAX_SPIKE_SAMPLES + 1)
        for i in range(width)
    ]
    return np.unique(np.concatenate(found))


@compiled
def _standing_out(values: Samples, least: float) -> NDArray[np.intp]:
    """Give samples, but for the margins, that are farther than `least` from the median of five about them.

    Looked at is where a sample or one beside it bends by more: a spike bends by its height at least, even
    where two of them lie side by side.
    """
    found = np.empty(len(values), dtype=np.intp)
    count, bent = 0, 0
    for i in range(MARGIN - 2, len(values) - MARGIN - MAX_SPIKE_SAMPLES):
        if abs((values[i + 2] - values[i + 1]) - (values[i + 1] - values[i])) > least:
            bent = i + 1
        if i < MARGIN or bent < i - 1:
            continue
        above = below = 0
        for j in range(i - 2, i + 3):
            above += values[i] - values[j] > least
            below += values[j] - values[i] > least
        if max(above, below) > 2:  # so is their median
            found[count] = i
            count += 1
    return found[:count].copy()


def _are_spikes(values: Samples, first: NDArray[np.intp], width: int, least: float) -> NDArray[np.bool_]:
    """Whether `width` samples from each index on are far from what both sides of them go on to."""
    before = values[first[:, None] + np.arange(-MARGIN, 0)]
    after = values[first[:, None] + np.arange(width, width + MARGIN)]
    inside = values[first[:, None] + np.arange(width)]
    lines = (
        2.0 * before[:, -1] - before[:, -2],
        2.0 * after[:, 0] - after[:, 1],
        np.median(np.column_stack([before[:, -2:], after[:, :2]]), axis=1),
    )
    away = np.min([np.abs(inside - line[:, None]).min(1) for line in lines], axis=0)
    slope = 0.5 * (before[:, -1] - before[:, -2] + after[:, 1] - after[:, 0])
    step = np.abs(after[:, 0] - before[:, -1] - (width + 1) * slope)
    bend = np.max([np.abs(np.diff(side, 2, axis=1)).max(1) for side in (before, after)], axis=0)
    return np.asarray(away > np.max([np.full(len(away), least), BENDS * bend, step / MAX_STEP], axis=0))


def _noise_by_bends(bends: Samples) -> float:
    return NORMAL_SCALE * median(bends) / math.sqrt(6.0)
