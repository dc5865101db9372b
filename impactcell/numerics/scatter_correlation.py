"""Scatter that is correlated from one estimate to the next, and what that does to its variance.

Estimates y_t = level + x_t with x_t = a x_(t-1) + e_t, std of x sigma: their differences have the variance
2 sigma^2 (1 - a), and a mean of many has sigma^2 (1 + a) / (1 - a) over their number (Bartlett 1946, J. R.
Stat. Soc. Suppl. 8:27). A filter that takes the scatter for white, with half the variance of the differences,
is too sure by (1 + a) / (1 - a)^2: 1.9 for a correlation of 0.2, 6 for 0.5. With its variance made larger by
that, levels, rates and steps come with their right uncertainty; a single estimate counts for less than it
could, which makes alarms later, never more frequent.
"""

import math
from typing import Final

from impactcell.numerics import autocorrelation
from impactcell.numerics.autocorrelation import Autocorrelation

MEMORY = 5000.0
"""Innovations after which one is forgotten."""
FEWEST = 20.0
"""Innovations before which nothing is said."""
DOUBTED = 1.5
"""Standard deviations up to which a correlation is taken for none: of white noise in 14 of 15 cases."""
LARGEST = 0.7
"""Correlations beyond it are a level that walks: their far lags are no longer the smaller part [1]."""
FAR_LAGS: Final = range(autocorrelation.FIRST_FAR, autocorrelation.LAGS + 1)
"""Lags at which the level is seen apart from the scatter."""
ROUNDS = 8
"""Of the fixed point below: within 0.002 of its end up to 0.6."""


def update(state: Autocorrelation, innovation: float) -> tuple[Autocorrelation, float]:
    """Take one normalised innovation; also give the lag-one correlation of the scatter, in [0, `LARGEST`].

    Lag one is the scatter's a and the level's part, the far lags are a^4 to a^8 and the level's part: their
    difference is the scatter's alone. What white noise shows by chance would make alarms later, so that it
    shrinks by the non-negative garrote (Breiman 1995, Technometrics 37:373): the share (`DOUBTED` over its
    score)^2 is taken off.
    """
    updated = autocorrelation.update(state, innovation, MEMORY)
    if updated.weight < FEWEST:
        return updated, 0.0
    excess = autocorrelation.next_to(updated) - autocorrelation.far(updated)
    score = excess * math.sqrt(updated.weight / (1.0 + 1.0 / autocorrelation.FAR))
    if score <= DOUBTED:
        return updated, 0.0
    correlation = min(excess, LARGEST)
    for _ in range(ROUNDS):
        correlation = min(excess + sum(correlation**lag for lag in FAR_LAGS) / autocorrelation.FAR, LARGEST)
    return updated, correlation * (1.0 - (DOUBTED / score) ** 2)


def variance_over_differences(correlation: float) -> float:
    """Variance that counts for levels, over half that of successive differences."""
    return (1.0 + correlation) / (1.0 - correlation) ** 2


def variance_over_scatter(correlation: float) -> float:
    """Variance that counts for levels, over that of the scatter."""
    return (1.0 + correlation) / (1.0 - correlation)
