"""What is known of wear: the probability that the limit is passed, and the cycles until it is."""

import math
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri

from impactcell.numerics.jit import compiled
from impactcell.records import Quality, WearState
from impactcell.tracking.wear_batch.run_length_model import SLOPES

INTERVAL = 0.95
"""Coverage of `WearState.cycles_to_limit_low` to `cycles_to_limit_high`."""
INTERVAL_STDS = float(ndtri(0.5 + INTERVAL / 2.0))
"""Half of that interval, in standard deviations."""
FARTHEST = 1e9
"""Cycles; a limit farther off than this is not reached: thirty years at one a second."""
BISECTION = 1e-10
"""Relative width at which a crossing is found."""


RATE_DOUBT = 0.25
"""Standard deviation by which wear may change its rate over as many cycles as it has been followed, in its
rate. Surfaces run in, and wear out; without it intervals and the probability at the horizon are those of
wear that is steady for ever."""


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


def extrapolation(moments: WearMoments, walks: tuple[float, float], limit: float) -> Extrapolation:
    """Level and slope as they go on from now, beside a limit."""
    return Extrapolation(
        moments.level - limit,
        moments.slope,
        max(moments.level_variance, 0.0),
        moments.level_slope_covariance,
        max(moments.slope_variance, 0.0),
        float(walks[0]),
        float(walks[1]),
    )


def walks_ahead(moments: WearMoments, walks: tuple[float, float], followed: float) -> tuple[float, float]:
    """Process variances of level and slope a cycle from now on: those seen, and that a rate may change.

    Parameters
    ----------
    followed : float
        Cycles for which wear has been followed.
    """
    return walks[0], walks[1] + (RATE_DOUBT * moments.slope) ** 2 / max(followed, 1.0)


@compiled
def probability_after(ahead: Extrapolation, cycles: float, slope_prior: float) -> float:
    """Probability that the level is above the limit after so many cycles.

    Level and slope were estimated under a slope that is normal with variance `slope_prior`, wide enough for
    the fastest wear: by it a young cell, which has told little of its slope, would pass any limit soon at
    nearly even odds. Here wear may go on on any of `SLOPES`, each as likely before the data. A prior that is
    `scale` times as wide is one more observation of a slope of nought, and the density of that observation
    the scale's evidence.
    """
    above = evidence = 0.0
    for scale in SLOPES:
        information = (1.0 / scale**2 - 1.0) / slope_prior
        spread = 1.0 + information * ahead.slope_variance
        likelihood = math.exp(-0.5 * information * ahead.slope**2 / spread) / (scale * math.sqrt(spread))
        pulled = ahead.level_slope_covariance * information / spread
        narrower = Extrapolation(
            ahead.excess - pulled * ahead.slope,
            ahead.slope / spread,
            max(ahead.level_variance - pulled * ahead.level_slope_covariance, 0.0),
            ahead.level_slope_covariance / spread,
            ahead.slope_variance / spread,
            ahead.level_walk,
            ahead.slope_walk,
        )
        mean = _quantile_above_limit(narrower, 0.0, cycles)
        std = _quantile_above_limit(narrower, 1.0, cycles) - mean
        evidence += likelihood
        above += likelihood * (
            0.5 * math.erfc(-mean / (math.sqrt(2.0) * std)) if std > 0.0 else 1.0 * (mean > 0.0)
        )
    return above / evidence


def forecast(
    moments: WearMoments,
    walks: tuple[float, float],
    limit: float,
    quality: Quality = Quality.GOOD,
    reason: str = "",
    probability_above: float | None = None,
    common_std: float = math.nan,
) -> WearState:
    """Say how level and slope stand to the limit.

    Parameters
    ----------
    walks : tuple of float
        Process variances of level and slope a cycle: they widen what is to come.
    probability_above : float, optional
        That the level is above the limit, where a normal distribution is not all that is known of it.
    common_std : float
        Of what all estimates share: it is told beside the level and is in nothing else.
    """
    level_variance, slope_variance = max(moments.level_variance, 0.0), max(moments.slope_variance, 0.0)
    std, excess = math.sqrt(level_variance), moments.level - limit
    if not math.isfinite(limit):
        above, cycles, low, high = 0.0, math.inf, math.inf, math.inf
    else:
        above = float(ndtr(excess / std)) if std > 0.0 else float(excess > 0.0)
        cycles, low, high = _cycles_to_limit(extrapolation(moments, walks, limit))
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
        common_std,
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
