"""Scatter that is correlated from one estimate to the next, and what that does to its variance.

Estimates y_t = level + x_t with x_t = a x_(t-1) + e_t, std of x sigma: their differences have the variance
2 sigma^2 (1 - a), and a mean of many has sigma^2 (1 + a) / (1 - a) over their number (Bartlett 1946, J. R.
Stat. Soc. Suppl. 8:27). A filter that takes the scatter for white, with half the variance of the differences,
is too sure by (1 + a) / (1 - a)^2: 1.9 for a correlation of 0.2, 6 for 0.5. With its variance made larger by
that, levels, rates and steps come with their right uncertainty; a single estimate counts for less than it
could, which makes alarms later, never more frequent.

Differences also tell a, whatever the level does meanwhile: over k estimates they have the variance
2 sigma^2 (1 - a^k), the variogram (Matheron 1963, Econ. Geol. 58:1246). A step is in a few of them only, and
a level that walks hardly moves any.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

MEMORY = 5000.0
"""Estimates after which one is forgotten."""
LAGS = 4
"""Estimates over which differences are taken: with more, a step is in more of them."""
FEWEST = 20.0
"""Differences before which nothing is said."""
BOUND = 3.5
"""A difference beyond so many of its standard deviations is an outlier's or a large step's, and not taken."""
DOUBTED = 1.5
"""Standard deviations up to which a correlation is taken for none: of white noise in 14 of 15 cases."""
LARGEST = 0.9
"""Correlations beyond it are a level that walks."""
ROUNDS = 6
"""Of Newton's method below: to rounding."""


@dataclass(frozen=True, slots=True)
class Variogram:
    """Fading sums of squared differences, each over its variance if the scatter were white.

    Attributes
    ----------
    recent : tuple of (float, float)
        The last `LAGS` estimates and their standard deviations, newest first.
    weights, squares : tuple of float
        How many differences over 1 to `LAGS` estimates there were, and the sum of their squares.
    correlation : float
        Lag-one correlation of the scatter that they show, in [0, `LARGEST`].
    """

    recent: tuple[tuple[float, float], ...] = ()
    weights: tuple[float, ...] = (0.0,) * LAGS
    squares: tuple[float, ...] = (0.0,) * LAGS
    correlation: float = 0.0


def update(variogram: Variogram, value: float, std: float) -> Variogram:
    """Take an estimate and its standard deviation."""
    kept, usual = 1.0 - 1.0 / MEMORY, 0.0
    weights, squares = [kept * weight for weight in variogram.weights], [kept * s for s in variogram.squares]
    for lag, (before, std_before) in enumerate(variogram.recent):
        usual += variogram.correlation**lag
        square = (value - before) ** 2 / (std**2 + std_before**2)
        if square <= BOUND**2 * usual:
            weights[lag] += 1.0
            squares[lag] += square
    recent = ((value, std), *variogram.recent[: LAGS - 1])
    return Variogram(recent, tuple(weights), tuple(squares), _correlation(weights, squares))


def begun_anew(variogram: Variogram) -> Variogram:
    """Take no difference across here: what comes is of another batch."""
    return replace(variogram, recent=())


def _correlation(weights: Sequence[float], squares: Sequence[float]) -> float:
    """Correlation from a variogram.

    Over k estimates the mean square is (1 - a^k) / (1 - a) of that over one. What it is beyond, on the mean
    over k from 2 on, is for white scatter normal with variance (1 + 1 / (`LAGS` - 1)) over the number of
    differences (Bartlett 1946). What it shows by chance would make alarms later, so that the correlation
    shrinks by the non-negative garrote (Breiman 1995, Technometrics 37:373): the share (`DOUBTED` over its
    score)^2 is taken off.
    """
    if min(weights) < FEWEST or squares[0] <= 0.0:
        return 0.0
    mean_squares = [s / weight for s, weight in zip(squares, weights, strict=True)]
    beyond = sum(mean_squares[1:]) / (LAGS - 1) / mean_squares[0] - 1.0
    score = beyond * math.sqrt(min(weights) / (1.0 + 1.0 / (LAGS - 1)))
    if score <= DOUBTED:
        return 0.0
    # a^j is in the mean squares over more than j
    shares = [(LAGS - j) / (LAGS - 1) for j in range(1, LAGS)]
    found = 0.0
    for _ in range(ROUNDS):
        excess = sum(share * found**j for j, share in enumerate(shares, 1)) - beyond
        found -= excess / sum(j * share * found ** (j - 1) for j, share in enumerate(shares, 1))
    return min(found, LARGEST) * (1.0 - (DOUBTED / score) ** 2)


def variance_over_differences(correlation: float) -> float:
    """Variance that counts for levels, over half that of successive differences."""
    return (1.0 + correlation) / (1.0 - correlation) ** 2


def variance_over_scatter(correlation: float) -> float:
    """Variance that counts for levels, over that of the scatter."""
    return (1.0 + correlation) / (1.0 - correlation)
