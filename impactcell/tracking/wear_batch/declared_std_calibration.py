"""How far the estimates' own standard deviations tell of their spread: all the way, in part, or not at all.

An estimate that declares s, where u is usual, scatters like u (s / u)^g. Honest standard deviations have
g = 1; those that are mostly the width of a prior that all estimates share have g = 0, and mixtures lie
between. The probabilities of some exponents follow from the densities of successive differences, each
predicted before it was known, and the variance used is the mean over them: an estimate that promises more
than the others is believed as far as such promises have been kept.
"""

import math

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import Samples

EXPONENTS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Exponents g that are weighed."""
PRIOR = (0.125, 0.125, 0.125, 0.125, 0.5)
"""Their probabilities before any difference: that standard deviations are honest is as likely as all else."""
OVERLAP = 2.0 / 3.0
"""Share of what a difference says that is new: successive ones have an estimate in common."""
FLOOR_NATS = 10.0
"""Log probability below the likeliest at which an exponent is kept, for velocities may change; nats."""
LARGEST_RATIO = 4.0
"""Times the usual beyond which an estimate is worse in proportion all the same."""
CONTAMINATED = 0.02
"""Share of differences with an outlier in them: two of the 1 % that estimates are taken to have."""
WIDE = 50.5
"""Their variance over that of a good one: (10^2 + 1) / 2, an outlier being ten times as wide."""
LARGEST_EXPONENT = 700.0
"""Largest argument of exp in double precision, about."""
SMALLEST_SCALE = 1e-6
"""Factors of the variance do not fall below this, so that identical values divide by no zero."""

LOG_PROBABILITY, SCALE = 0, 1
"""Columns of a posterior over the exponents."""


def prior_posterior() -> Samples:
    """Posterior before any difference, shape (5, 2): a row an exponent, columns as above."""
    return np.column_stack([np.log(PRIOR), np.ones(len(PRIOR))])


@compiled
def outlier_weight(squared: float, factor: float) -> float:
    """How much of a squared difference counts for the variance: by the odds of an outlier in it."""
    odds = CONTAMINATED / (1.0 - CONTAMINATED) / math.sqrt(WIDE)
    odds *= math.exp(min(0.5 * squared / factor * (1.0 - 1.0 / WIDE), LARGEST_EXPONENT))
    good = 1.0 / (1.0 + odds)
    return good + (1.0 - good) / WIDE


@compiled
def calibrated_std(posterior: Samples, std: float, usual: float) -> float:
    """Give the standard deviation to go with a declared one; with the usual one, the usual one itself."""
    if std == usual or not usual > 0.0:
        return std
    ratio = min(std / usual, LARGEST_RATIO)
    above = below = 0.0
    for i, exponent in enumerate(EXPONENTS):
        share = math.exp(posterior[i, LOG_PROBABILITY]) * posterior[i, SCALE]
        above += share * ratio ** (2.0 * exponent)
        below += share
    return std / ratio * math.sqrt(above / below)


@compiled
def calibrated_stds(posterior: Samples, stds: Samples, usual: float) -> Samples:
    """Give the standard deviations to go with those that a history declares, each as `calibrated_std`."""
    calibrated = np.empty(len(stds))
    for i, std in enumerate(stds):
        calibrated[i] = calibrated_std(posterior, std, usual)
    return calibrated


@compiled
def update(
    posterior: Samples, squared: float, std: float, last: float, usual: float, weight: float
) -> Samples:
    """Posterior after one more difference.

    Parameters
    ----------
    squared : float
        Square of the difference, over the variance of a usual one.
    std, last, usual : float
        Standard deviations that the two estimates declare, and the usual one.
    weight : float
        Number of differences so far.
    """
    updated, top = posterior.copy(), -np.inf
    for i, exponent in enumerate(EXPONENTS):
        variance = 0.5 * ((std / usual) ** (2.0 * exponent) + (last / usual) ** (2.0 * exponent))
        scaled, scale = squared / variance, updated[i, SCALE]
        good = math.log(1.0 - CONTAMINATED) - 0.5 * scaled / scale
        outlying = math.log(CONTAMINATED / math.sqrt(WIDE)) - 0.5 * scaled / (scale * WIDE)
        density = (
            max(good, outlying)
            + math.log1p(math.exp(-abs(good - outlying)))
            - 0.5 * math.log(scale * variance)
        )
        updated[i, LOG_PROBABILITY] += OVERLAP * density
        updated[i, SCALE] = max(
            scale + (scaled * outlier_weight(scaled, scale) - scale) / weight, SMALLEST_SCALE
        )
        top = max(top, updated[i, LOG_PROBABILITY])
    total = 0.0
    for i in range(len(updated)):
        updated[i, LOG_PROBABILITY] = max(updated[i, LOG_PROBABILITY] - top, -FLOOR_NATS)
        total += math.exp(updated[i, LOG_PROBABILITY])
    updated[:, LOG_PROBABILITY] -= math.log(total)
    return updated
