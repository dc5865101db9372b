"""Noise of a channel: as its sensor states it, else as neighbouring samples show it."""

import math

import numpy as np

from impactcell.numerics.local_polynomial import median_third_difference
from impactcell.records import Channel, Samples

NORMAL_MAD = 1.482602218505602
"""Standard deviation of a normal variable over the median of its absolute value, 1 / Phi^-1(3/4)."""
THIRD_DIFFERENCE_STD = math.sqrt(20.0)
"""Standard deviation of the third difference of white noise over that of the noise: 1 + 9 + 9 + 1 = 20."""
ROUNDING = 8.0 * float(np.finfo(np.float64).eps)
"""What decimals that were read leave of the third difference of equal steps of a raster, over the largest
value: four values of weights 1, 3, 3 and 1, each off by half an eps, and as much again for the sums."""
MIN_RELATIVE_NOISE = 1e-9
"""Noise over the largest value below which a channel without any is taken to have this: rounding of data."""


def noise_std(channel: Channel) -> float:
    """Give the standard deviation of one sample: the sensor's white noise and the raster of its code.

    Where the sensor's noise is not known it is `white_noise_std`, and no less than what the raster makes.
    """
    raster = (channel.resolution or 0.0) / math.sqrt(12.0)
    if channel.noise_std is not None:
        return math.hypot(channel.noise_std, raster)
    finite = channel.values[np.isfinite(channel.values)]
    if len(finite) == 0:
        return raster
    return max(white_noise_std(finite), raster, MIN_RELATIVE_NOISE * float(np.abs(finite).max()))


def white_noise_std(values: Samples) -> float:
    """Estimate the noise that differs from sample to sample, from third differences.

    A motion that is a parabola over four samples does not move them, and half of them may be off for a jump
    or a spike. Where more than half are zero, or as near to it as decimals of a file are rounded, as on a
    coarse raster, it is their root mean square; nan for fewer than four values, which may not hold any that
    is not finite.
    """
    if len(values) < 4:
        return math.nan
    spread = median_third_difference(values) * NORMAL_MAD
    if spread <= ROUNDING * float(np.abs(values).max()):
        spread = float(np.diff(values, 3).std())
    return spread / THIRD_DIFFERENCE_STD
