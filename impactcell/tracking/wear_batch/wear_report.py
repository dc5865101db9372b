"""What is believed of wear: probability above the limit, and cycles until it is reached."""

import math

import numpy as np
from scipy.special import ndtr, ndtri

from impactcell.numerics.jit import compiled
from impactcell.records import Quality, WearState

INTERVAL = 0.95  # coverage of cycles_to_limit_low .. high
SPREAD = float(ndtri(0.5 + INTERVAL / 2.0))
FARTHEST = 1e9  # cycles; a limit farther off than this is not reached


def wear_state(
    level: float,
    slope: float,
    covariance: tuple[float, float, float],
    noise: tuple[float, float],
    limit: float,
    quality: Quality,
    reason: str,
) -> WearState:
    """Make the published state of wear.

    Parameters
    ----------
    covariance : tuple
        Variance of the level, its covariance with the slope, variance of the slope.
    noise : tuple
        Process variances of level and slope a cycle: they widen what is to come.
    """
    level_var, cross, slope_var = (max(covariance[0], 0.0), covariance[1], max(covariance[2], 0.0))
    std = math.sqrt(level_var)
    if not math.isfinite(limit):
        above, expected, low, high = 0.0, math.inf, math.inf, math.inf
    else:
        above = float(ndtr((level - limit) / std)) if std > 0.0 else float(level > limit)
        spreads = (level_var, cross, slope_var, *noise)
        expected, low, high = _cycles_to_limit(level - limit, slope, spreads)
    return WearState(
        level, std, slope, math.sqrt(slope_var), limit, above, expected, low, high, quality, reason
    )


@compiled
def _level_above_limit(
    above: float, slope: float, spreads: tuple[float, float, float, float, float], z: float, cycles: float
) -> float:
    """Return level minus limit after so many cycles, plus z standard deviations of it."""
    level_var, cross, slope_var, level_noise, slope_noise = spreads
    variance = level_var + cycles * (2.0 * cross + cycles * slope_var)
    variance += level_noise * cycles + slope_noise * cycles**3 / 3.0
    return above + slope * cycles + z * math.sqrt(max(variance, 0.0))


@compiled
def _cycles_to_limit(
    above: float, slope: float, spreads: tuple[float, float, float, float, float]
) -> tuple[float, float, float]:
    """Cycles until the limit is reached, and both ends of their interval."""
    return (
        _first_crossing(above, slope, spreads, 0.0),
        _first_crossing(above, slope, spreads, SPREAD),
        _first_crossing(above, slope, spreads, -SPREAD),
    )


@compiled
def _first_crossing(
    above: float, slope: float, spreads: tuple[float, float, float, float, float], z: float
) -> float:
    """First cycle at which `_level_above_limit` is positive, by bisection; inf if beyond `FARTHEST`."""
    if _level_above_limit(above, slope, spreads, z, 0.0) >= 0.0:
        return 0.0
    near, far = 0.0, 1.0
    while _level_above_limit(above, slope, spreads, z, far) < 0.0:
        near, far = far, far * 2.0
        if far > FARTHEST:
            return np.inf
    while far - near > 1e-10 * far:
        middle = 0.5 * (near + far)
        if _level_above_limit(above, slope, spreads, z, middle) < 0.0:
            near = middle
        else:
            far = middle
    return far
