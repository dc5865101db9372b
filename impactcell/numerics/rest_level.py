"""Where a sensor stands while nothing moves, and how well samples tell it."""

import math

import numpy as np
from numpy.typing import NDArray

FEWEST = 5
"""Samples that a level is told by."""
APART_STD = 6.0
"""Standard deviations of a sample, or steps of its raster, from the median beyond which it is no rest."""
FLAT_STD = 4.0
"""How far two halves of samples may lie apart, in standard deviations of that: else the first was no rest."""


def rest_level(values: NDArray[np.float64], noise_std: float, raster: float = 0.0) -> tuple[float, float]:
    """Give the level on which samples end, as far back as they agree, and its standard deviation.

    On a raster of step q the mean is what is meant only with noise s that reaches from step to step: it is
    off by a share of exp(-2 pi² s² / q²) of a rounding error (Widrow and Kollár, Quantization Noise, 2008,
    ch. 19), however many samples there are.

    Parameters
    ----------
    values : ndarray, shape (n,)
    noise_std : float
        Of one sample, rounding included.
    raster : float
        Step of the values; 0 where they lie on none.

    Examples
    --------
    >>> rest_level(np.array([9.0, 9.5, 8.5, 9.0, 9.0, 2.0, 3.0, 2.5, 1.0, 1.5]), 0.5)[0]
    2.0
    >>> rest_level(np.full(1000, 7.0), 0.0, raster=0.0)
    (7.0, 0.0)
    """
    half = len(values) // 2
    if half >= FEWEST:
        (first, first_std), (last, last_std) = (
            _mean(part, noise_std, raster) for part in (values[:half], values[half:])
        )
        if abs(first - last) > FLAT_STD * math.hypot(first_std, last_std):
            return rest_level(values[half:], noise_std, raster)
    return _mean(values, noise_std, raster)


def _mean(values: NDArray[np.float64], noise_std: float, raster: float) -> tuple[float, float]:
    """Mean without samples that lie apart, and its standard deviation."""
    apart = np.abs(values - np.median(values))
    near = values[apart <= max(APART_STD * max(noise_std, raster), float(np.median(apart)))]
    variance = float(np.var(near))
    std = math.sqrt(max(variance, noise_std**2) / len(near))
    if not raster:
        return float(near.mean()), std
    unrounded = max(min(variance, noise_std**2) - raster**2 / 12.0, 0.0)
    reach = math.pi * math.sqrt(unrounded) / raster
    return float(near.mean()), math.hypot(std, raster / math.sqrt(12.0) * math.exp(-2.0 * reach * reach))
