"""Noise of a channel: as its sensor states it, else as neighbouring samples show it."""

import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from impactcell.numerics.local_polynomial import median_third_difference
from impactcell.records import Channel, Samples

NORMAL_MAD = 1.482602218505602
"""Standard deviation of a normal variable over the median of its absolute value, 1 / Phi^-1(3/4)."""
THIRD_DIFFERENCE_STD = math.sqrt(20.0)
"""Standard deviation of the third difference of white noise over that of the noise: 1 + 9 + 9 + 1 = 20."""
ROUNDING = 8.0 * float(np.finfo(np.float64).eps)
"""What decimals that were read leave of the third difference of equal steps of a raster, over the largest
value: four values of weights 1, 3, 3 and 1, each off by half an eps, and as much again for the sums."""
MIN_TIED = 0.05
"""Third differences that are as large as their median, as a share, from which on a raster is coarse: of noise
that is three steps wide 9 in 100 are."""
TRIMMED_STD, TRIMMED_STEPS, TRIMMING_ROUNDS = 5.0, 8.0, 3
"""Third differences on a raster that are left out, in their own standard deviations and in its steps, of
which rounding alone makes up to four; jumps and spikes are gone after so many rounds."""
EQUAL_STEPS = 0.05
"""Share of the usual step by which another may be off it and count as equal: frames whose times were rounded
to 1 ms are, to 3 % at 30 in a second."""
MIN_EQUAL_SHARE = 0.25
"""Third differences over equal steps that tell a channel's noise, as a share of all: of a film that lost 35 %
of its frames, each by itself, they are a quarter."""
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


def are_equal_steps(times: Samples) -> bool:
    """Whether samples follow one another in equal steps."""
    return bool(np.all(_is_usual(np.diff(times))))


def white_noise_std(values: Samples, times: Samples | None = None) -> float:
    """Estimate the noise that differs from sample to sample, from third differences.

    A motion that is a parabola over four samples does not move them, and half of them may be off for a jump
    or a spike. On a coarse raster many are as large as their median, but for what decimals of a file are
    rounded, and that says little: then it is their root mean square without the largest, and no less than
    what rounding makes; nan for fewer than four values, which may not hold any that is not finite. So it is
    above 0 for an exact record, too: `noise_of` of the numerics tells whether a channel shows noise at all.
    Where `times` tell that steps are not equal, as where samples were lost, those over equal ones count, or
    if they are few all, by weights that a parabola does not move either.
    """
    if len(values) < 4:
        return math.nan
    if times is None or are_equal_steps(times):
        third, median = np.diff(values, 3), median_third_difference(values)
    else:
        third = _third_differences(values, times)
        median = float(np.median(np.abs(third)))
    apart = np.abs(np.abs(third) - median)
    is_tied = apart <= ROUNDING * float(np.abs(values).max())
    if float(np.mean(is_tied)) < MIN_TIED:
        return median * NORMAL_MAD / THIRD_DIFFERENCE_STD
    step = float(np.min(apart[~is_tied], initial=np.inf))
    if math.isinf(step):
        return median / THIRD_DIFFERENCE_STD
    for _ in range(TRIMMING_ROUNDS):
        largest = max(TRIMMED_STD * float(third.std()), TRIMMED_STEPS * step)
        third = third[np.abs(third) <= largest]
    return max(float(third.std()) / THIRD_DIFFERENCE_STD, step / math.sqrt(12.0))


def _is_usual(steps: Samples) -> NDArray[np.bool_]:
    usual = np.median(steps)
    is_usual: NDArray[np.bool_] = np.abs(steps - usual) <= EQUAL_STEPS * usual
    return is_usual


def _third_differences(values: Samples, times: Samples) -> Samples:
    """Third differences over equal steps; if those are few divided ones, of weights as large in all."""
    is_equal = np.all(sliding_window_view(_is_usual(np.diff(times)), 3), axis=1)
    if float(is_equal.mean()) >= MIN_EQUAL_SHARE:
        third: Samples = np.diff(values, 3)[is_equal]
        return third
    near = sliding_window_view(times, 4)
    apart = near[:, :, np.newaxis] - near[:, np.newaxis, :] + np.eye(4)
    weights = 1.0 / np.prod(apart, axis=2)
    weights *= THIRD_DIFFERENCE_STD / np.sqrt(np.sum(weights**2, axis=1, keepdims=True))
    divided: Samples = np.sum(weights * sliding_window_view(values, 4), axis=1)
    return divided
