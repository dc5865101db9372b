"""How noisy the estimates really are: the factor between their own standard deviation and the data's.

The factor comes from differences of successive estimates, which neither wear nor a batch step moves:
E (z_n - z_{n-1})^2 = kappa^2 (s_n^2 + s_{n-1}^2). It is the maximum-likelihood one of a contaminated normal,
by incremental EM; a winsorised one beside it pulls it up quickly where the declared scale is far too small.
Where one standard deviation for all is clearly likelier than those declared, as where these are the width of
a prior that every estimate shares, it is used instead.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.compiled import compiled
from impactcell.records import Samples

CLIP = 2.5
# E min(e^2, c^2) of a standard normal e, c = 2.5: what winsorising takes away
_DENSITY = math.exp(-0.5 * CLIP**2) / math.sqrt(2.0 * math.pi)
_INSIDE = math.erf(CLIP / math.sqrt(2.0))
CONSISTENCY = _INSIDE - 2.0 * CLIP * _DENSITY + CLIP**2 * (1.0 - _INSIDE)
CONTAMINATED = 0.02  # differences with an outlier in them
WIDE = 50.5  # their variance over that of a good one: (10^2 + 1) / 2
UNSCALED = 6.0  # differences before a guessed scale is good enough to know an outlier
ROUGH_BIAS = 1.25  # by which outliers may raise the winsorised factor
MEMORY = 5000.0  # cycles after which the factor forgets
DECLARED_WEIGHT = 10.0  # differences that a declared standard deviation counts for
GUESSED_RELATIVE_STD = 0.01  # where no standard deviation was ever declared: of the value itself
CONTRADICTED = 2.0  # a factor beyond this, or below its inverse, says the declared scale is no guide
FAR_OFF = 4.0  # an estimate that declares so many times the common one is worse than the others all the same
CLEARLY = 2.0  # nats by which one standard deviation for all must be likelier than those declared
SMALLEST_GUESS = 1e-6
SMALLEST_FACTOR = 1e-6


@dataclass(frozen=True, slots=True)
class Noise:
    """Factor of the noise and what it was learned from.

    Attributes
    ----------
    factor : float
        kappa squared.
    weight : float
        Number of differences it rests on.
    rough : float
        The winsorised one.
    usual_std : float
        Declared standard deviation as it usually is; nan before one was declared.
    last_value, last_std : float
        The estimate before, with the declared standard deviation used for it; nan before the first.
    identical : int
        How many values in a row have been the same.
    guessed : bool
        No standard deviation was ever declared; the scale was guessed and is learned.
    common : bool
        The usual standard deviation is used for every estimate, whatever it declares.
    """

    factor: float = 1.0
    weight: float = DECLARED_WEIGHT
    rough: float = 1.0
    usual_std: float = math.nan
    last_value: float = math.nan
    last_std: float = math.nan
    identical: int = 0
    guessed: bool = False
    common: bool = False


def in_a_row(noise: Noise, value: float) -> int:
    """Count how many values in a row have been the same, with this one."""
    return noise.identical + 1 if value == noise.last_value else 1


def take(noise: Noise, value: float, declared: float, *, late: bool) -> tuple[Noise, float]:
    """Take in an estimate, and its difference from the one before into the factor unless it comes late.

    Returns
    -------
    noise : Noise
    std : float
        To go with the value: its own, the usual one, or a guess to be corrected.
    """
    std, usual, weight, guessed = declared, noise.usual_std, noise.weight, noise.guessed
    if noise.common:
        std = declared if declared > FAR_OFF * usual else usual
    elif declared > 0.0 and math.isfinite(declared):
        usual = std if math.isnan(usual) else usual + 0.05 * (std - usual)
    elif not math.isnan(usual):
        std = usual
    else:
        std = usual = max(GUESSED_RELATIVE_STD * abs(value), SMALLEST_GUESS)
        weight, guessed = 0.0, True
    factor, rough, last_value, last_std = noise.factor, noise.rough, noise.last_value, noise.last_std
    identical = in_a_row(noise, value)
    if late:
        return Noise(
            factor, weight, rough, usual, last_value, last_std, identical, guessed, noise.common
        ), std
    if not math.isnan(last_value):
        squared = (value - last_value) ** 2 / (std**2 + last_std**2)
        weight = min(weight + 1.0, MEMORY)
        if guessed and weight <= UNSCALED:
            # nothing to judge outliers by yet: the plain mean
            factor = rough = max(factor + (squared - factor) / weight, SMALLEST_FACTOR)
        else:
            clipped = min(squared, CLIP**2 * rough) / CONSISTENCY
            rough = max(rough + (clipped - rough) / weight, SMALLEST_FACTOR)
            own = squared * _share(squared, factor)
            factor = max(factor + (own - factor) / weight, rough / ROUGH_BIAS, SMALLEST_FACTOR)
    return Noise(factor, weight, rough, usual, value, std, identical, guessed, noise.common), std


def variance(noise: Noise, std: float) -> float:
    """Variance of an estimate that declares `std`; wider while a guessed scale rests on few differences."""
    doubt = 1.0 + 4.0 / max(noise.weight, 1.0) if noise.guessed else 1.0
    return noise.factor * doubt * std**2


def one_for_all(noise: Noise, values: Samples, stds: Samples) -> Noise:
    """Use one standard deviation for all from here on, if that explains the first values clearly better."""
    if noise.common or noise.guessed or np.ptp(stds) == 0.0:
        return noise
    usual = float(np.median(stds))
    declared, alike = stds[1:] ** 2 + stds[:-1] ** 2, np.full(len(stds) - 1, 2.0 * usual**2)
    squares = np.diff(values) ** 2
    if _likelihood(squares, alike) < _likelihood(squares, declared) + CLEARLY:
        return noise
    return replace(noise, common=True, usual_std=usual, last_std=usual)


def _likelihood(squares: Samples, variances: Samples) -> float:
    """Log likelihood of differences at their likeliest factor, a few of them with an outlier in."""
    scaled = squares / variances
    factor = _fit(scaled, _start(scaled), 0.0)
    good = (1.0 - CONTAMINATED) * np.exp(-0.5 * scaled / factor)
    odd = CONTAMINATED / math.sqrt(WIDE) * np.exp(-0.5 * scaled / (factor * WIDE))
    return float(np.sum(np.log(np.maximum(good + odd, 1e-300)) - 0.5 * np.log(factor * variances)))


def settle(noise: Noise, values: Samples, stds: Samples) -> Noise:
    """Fit the factor to all of the first values at once, for following it up from a wrong one takes long."""
    squared = np.diff(values) ** 2 / (stds[1:] ** 2 + stds[:-1] ** 2)
    start = _start(squared)
    factor = _fit(squared, start, 0.0 if noise.guessed else DECLARED_WEIGHT)
    if not 1.0 / CONTRADICTED < factor < CONTRADICTED:
        # what was declared is plainly wrong, and is no longer to weigh against the data
        factor = _fit(squared, start, 0.0)
    return replace(noise, factor=factor, rough=factor)


def _start(squared: Samples) -> float:
    """Factor by the median, which outliers hardly move: that of a squared standard normal is 0.4549."""
    return max(float(np.median(squared)) / 0.4549, SMALLEST_FACTOR)


@compiled
def _share(squared: float, factor: float) -> float:
    """How much of a squared difference counts: by the odds that there is an outlier in it."""
    odds = CONTAMINATED / (1.0 - CONTAMINATED) / math.sqrt(WIDE)
    odds *= math.exp(min(0.5 * squared / factor * (1.0 - 1.0 / WIDE), 700.0))
    good = 1.0 / (1.0 + odds)
    return good + (1.0 - good) / WIDE


@compiled
def _fit(squared: Samples, factor: float, before: float) -> float:
    """Fit the factor to squared differences by EM, with `before` differences at a factor of one."""
    for _ in range(30):
        total = 0.0
        for one in squared:
            total += one * _share(one, factor)
        factor = max((before + total) / (before + len(squared)), SMALLEST_FACTOR)
    return factor
