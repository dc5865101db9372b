"""What is believed of wear: probability above the limit, and cycles until it is reached."""

import math
from collections.abc import Callable

from scipy.optimize import brentq
from scipy.special import ndtr, ndtri

from impactcell.records import Quality, WearState

INTERVAL = 0.95  # coverage of cycles_to_limit_low .. high
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

        def reached(cycles: float, z: float) -> float:
            variance = level_var + cycles * (2.0 * cross + cycles * slope_var)
            variance += noise[0] * cycles + noise[1] * cycles**3 / 3.0
            return level + slope * cycles + z * math.sqrt(max(variance, 0.0)) - limit

        spread = float(ndtri(0.5 + INTERVAL / 2.0))
        expected, low, high = (_first(reached, z) for z in (0.0, spread, -spread))
    return WearState(
        level, std, slope, math.sqrt(slope_var), limit, above, expected, low, high, quality, reason
    )


def _first(reached: Callable[[float, float], float], z: float) -> float:
    """First number of cycles at which `reached` is positive; inf if beyond FARTHEST."""
    if reached(0.0, z) >= 0.0:
        return 0.0
    near, far = 0.0, 1.0
    while reached(far, z) < 0.0:
        near, far = far, far * 2.0
        if far > FARTHEST:
            return math.inf
    return float(brentq(reached, near, far, args=(z,), rtol=1e-9))
