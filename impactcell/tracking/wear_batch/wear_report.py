"""What is known of wear: the probability that the limit is passed, and the cycles until it is."""

import math
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri

from impactcell.numerics.jit import compiled
from impactcell.records import Quality, WearState

INTERVAL = 0.95
"""Coverage of `WearState.cycles_to_limit_low` to `cycles_to_limit_high`."""
INTERVAL_STDS = float(ndtri(0.5 + INTERVAL / 2.0))
"""Half of that interval, in standard deviations."""
FARTHEST = 1e9
"""Cycles; a limit farther off than this is not reached: thirty years at one a second."""
BISECTION = 1e-10
"""Relative width at which a crossing is found."""


class WearMoments(NamedTuple):
    """Level of mu_s at the reference batch and its slope a cycle: means, variances and covariance."""

    level: float
    slope: float
    level_variance: float
    level_slope_covariance: float
    slope_variance: float


class Extrapolation(NamedTuple):
    """Level minus limit and how it goes on: `WearMoments`, and process variances of both a cycle."""

    excess: float
    slope: float
    level_variance: float
    level_slope_covariance: float
    slope_variance: float
    level_walk: float
    slope_walk: float


def forecast(
    moments: WearMoments,
    walks: tuple[float, float],
    limit: float,
    quality: Quality = Quality.GOOD,
    reason: str = "",
    probability_above: float | None = None,
) -> WearState:
    """Say how level and slope stand to the limit.

    Parameters
    ----------
    walks : tuple of float
        Process variances of level and slope a cycle: they widen what is to come.
    probability_above : float, optional
        That the level is above the limit, where a normal distribution is not all that is known of it.
    """
    level_variance, slope_variance = max(moments.level_variance, 0.0), max(moments.slope_variance, 0.0)
    std, excess = math.sqrt(level_variance), moments.level - limit
    if not math.isfinite(limit):
        above, cycles, low, high = 0.0, math.inf, math.inf, math.inf
    else:
        above = float(ndtr(excess / std)) if std > 0.0 else float(excess > 0.0)
        ahead = Extrapolation(
            excess,
            moments.slope,
            level_variance,
            moments.level_slope_covariance,
            slope_variance,
            float(walks[0]),
            float(walks[1]),
        )
        cycles, low, high = _cycles_to_limit(ahead)
    slope_std = math.sqrt(slope_variance)
    return WearState(
        moments.level,
        std,
        moments.slope,
        slope_std,
        limit,
        above if probability_above is None else probability_above,
        cycles,
        low,
        high,
        quality,
        reason,
    )


@compiled
def _quantile_above_limit(ahead: Extrapolation, stds: float, cycles: float) -> float:
    """Return level minus limit after so many cycles, plus `stds` standard deviations of it.

    The slope's random walk, integrated, adds a third of its variance times the cube of the cycles.
    """
    variance = ahead.level_variance + cycles * (
        2.0 * ahead.level_slope_covariance + cycles * ahead.slope_variance
    )
    variance += ahead.level_walk * cycles + ahead.slope_walk * cycles**3 / 3.0
    return ahead.excess + ahead.slope * cycles + stds * math.sqrt(max(variance, 0.0))


@compiled
def _cycles_to_limit(ahead: Extrapolation) -> tuple[float, float, float]:
    """Cycles until the level meets the limit, and both ends of their interval, where its quantiles do."""
    return (
        _first_crossing(ahead, 0.0),
        _first_crossing(ahead, INTERVAL_STDS),
        _first_crossing(ahead, -INTERVAL_STDS),
    )


@compiled
def _first_crossing(ahead: Extrapolation, stds: float) -> float:
    """Cycles until the level plus `stds` standard deviations is at the limit; inf if beyond `FARTHEST`."""
    if _quantile_above_limit(ahead, stds, 0.0) >= 0.0:
        return 0.0
    near, far = 0.0, 1.0
    while _quantile_above_limit(ahead, stds, far) < 0.0:
        near, far = far, far * 2.0
        if far > FARTHEST:
            return np.inf
    while far - near > BISECTION * far:
        middle = 0.5 * (near + far)
        if _quantile_above_limit(ahead, stds, middle) < 0.0:
            near = middle
        else:
            far = middle
    return far
