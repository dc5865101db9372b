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
PRIOR = (0.125, 0.125, 0.125, 0.125, 0.5)
OVERLAP = 2.0 / 3.0  # successive differences share an estimate: so much of what they say is new
DOUBT = 10.0  # nats below the likeliest exponent at which one is kept, for velocities may change
FAR_OFF = 4.0  # an estimate that declares so many times the usual is worse in proportion all the same
CONTAMINATED = 0.02  # differences with an outlier in them
WIDE = 50.5  # their variance over that of a good one: (10^2 + 1) / 2
SMALLEST_SCALE = 1e-6

WEIGHT, SCALE = 0, 1


def prior_posterior() -> Samples:
    """Belief before any difference, a row an exponent: log probability, factor of the variance."""
    return np.column_stack([np.log(PRIOR), np.ones(len(PRIOR))])


@compiled
def outlier_weight(squared: float, factor: float) -> float:
    """How much of a squared difference counts for the variance: by the odds of an outlier in it."""
    odds = CONTAMINATED / (1.0 - CONTAMINATED) / math.sqrt(WIDE)
    odds *= math.exp(min(0.5 * squared / factor * (1.0 - 1.0 / WIDE), 700.0))
    good = 1.0 / (1.0 + odds)
    return good + (1.0 - good) / WIDE


@compiled
def calibrated_std(belief: Samples, std: float, usual: float) -> float:
    """Give the standard deviation to go with a declared one; with the usual one, the usual one itself."""
    if std == usual or not usual > 0.0:
        return std
    ratio = min(std / usual, FAR_OFF)
    above = below = 0.0
    for i, exponent in enumerate(EXPONENTS):
        share = math.exp(belief[i, WEIGHT]) * belief[i, SCALE]
        above += share * ratio ** (2.0 * exponent)
        below += share
    return std / ratio * math.sqrt(above / below)


@compiled
def update(belief: Samples, squared: float, std: float, last: float, usual: float, weight: float) -> Samples:
    """Belief after one more difference.

    Parameters
    ----------
    squared : float
        Square of the difference, over the variance of a usual one.
    std, last, usual : float
        Standard deviations that the two estimates declare, and the usual one.
    weight : float
        Number of differences so far.
    """
    found, top = belief.copy(), -np.inf
    for i, exponent in enumerate(EXPONENTS):
        variance = 0.5 * ((std / usual) ** (2.0 * exponent) + (last / usual) ** (2.0 * exponent))
        own, scale = squared / variance, found[i, SCALE]
        good = math.log(1.0 - CONTAMINATED) - 0.5 * own / scale
        odd = math.log(CONTAMINATED / math.sqrt(WIDE)) - 0.5 * own / (scale * WIDE)
        density = max(good, odd) + math.log1p(math.exp(-abs(good - odd))) - 0.5 * math.log(scale * variance)
        found[i, WEIGHT] += OVERLAP * density
        found[i, SCALE] = max(scale + (own * outlier_weight(own, scale) - scale) / weight, SMALLEST_SCALE)
        top = max(top, found[i, WEIGHT])
    total = 0.0
    for i in range(len(found)):
        found[i, WEIGHT] = max(found[i, WEIGHT] - top, -DOUBT)
        total += math.exp(found[i, WEIGHT])
    found[:, WEIGHT] -= math.log(total)
    return found
