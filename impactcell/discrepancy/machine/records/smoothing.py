"""Speeds, accelerations and means of what is sampled at equal steps, by weights of compact support."""

import numpy as np

from impactcell.records import Samples

TEST_FUNCTION_POWER = 4
"""w = (1 - s²)^4: three derivatives vanish at its ends [1]."""


def smoothed_speed(position: Samples, half: int, step: float) -> Samples:
    """Differentiate by weighted slopes over `2 half + 1` samples: shape (n,)."""
    weight = slope_weights(half) / step
    padded = np.pad(position, half, mode="reflect", reflect_type="odd")
    return np.convolve(padded, weight[::-1], "valid")


def of_speeds(weight: Samples, step: float) -> Samples:
    """Weights of speeds that are what these, which add up to 0, are of positions summed up from them.

    By the trapezoidal rule.
    """
    after = -np.cumsum(weight)[:-1]  # of each difference of two positions
    return np.convolve(after, [0.5 * step, 0.5 * step])


def slope_weights(half: int) -> Samples:
    """Weights of the slope of a cubic in its middle: a parabola of the speed within them leaves no error."""
    lever = np.arange(-half, half + 1.0)
    second, fourth, sixth = (float(np.sum(lever**power)) for power in (2, 4, 6))
    weight: Samples = (sixth * lever - fourth * lever**3) / (second * sixth - fourth**2)
    return weight


def smoothed_acceleration(position: Samples, half: int, step: float) -> Samples:
    """Second derivative as the rows of the regression have it, shape (n,)."""
    _, curvature = test_function(half, step)
    padded = np.pad(position, half + 1, mode="reflect", reflect_type="odd")
    return np.convolve(padded, curvature, "valid")


def averaged(values: Samples, half: int, step: float) -> Samples:
    """Mean of a signal as the rows of the regression have it, shape (n,)."""
    weight, _ = test_function(half, step)
    return np.convolve(np.pad(values, half + 1, mode="reflect"), weight, "valid")


def second_difference(span: int) -> Samples:
    """Weights of x - 2 y + z, so many samples apart, shape (2 span + 1,)."""
    weight = np.zeros(2 * span + 1)
    weight[[0, span, -1]] = 1.0, -2.0, 1.0
    return weight


def bell(half: int) -> Samples:
    """Weights of a mean by samples of w alone, shape (2 half + 3,).

    With second differences they go together for what is held from sample to sample and has been averaged with
    the hat of a second difference, from one sample before to one after.
    """
    place = np.arange(-half - 1, half + 2) / (half + 1.0)
    weight: Samples = np.maximum(1.0 - place**2, 0.0) ** TEST_FUNCTION_POWER
    weight /= weight.sum()
    return weight


def test_function(half: int, step: float) -> tuple[Samples, Samples]:
    """Weights of a mean, and of the mean second derivative by second differences, shape (2 half + 3,).

    A second difference is q'' and a twelfth of the second difference of q'', to the fourth order of the step;
    the weights of the mean are so too (Numerov 1924), and the two belong together.
    """
    weight = bell(half)
    curvature = np.convolve(weight, [1.0, -2.0, 1.0], "same") / step**2
    return np.convolve(weight, np.array([1.0, 10.0, 1.0]) / 12.0, "same"), curvature


def test_slope(weight: Samples, step: float) -> Samples:
    """Weights of the mean first derivative by central differences, of those of a mean."""
    return np.convolve(weight, [-1.0, 0.0, 1.0], "same") / (2.0 * step)
