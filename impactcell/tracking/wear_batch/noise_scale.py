"""How noisy the estimates really are: the factor between their own standard deviation and the data's.

The factor comes from differences of successive estimates, which neither wear nor a batch step moves:
E (z_n - z_{n-1})^2 = kappa^2 (s_n^2 + s_{n-1}^2). It is the maximum-likelihood one of a contaminated normal,
by incremental EM; a winsorised one beside it pulls it up quickly where the declared scale is far too small.
How much wider or narrower than usual an estimate is, it declares itself, as far as that has been borne out
(`impactcell.tracking.wear_batch.declared_std_calibration`).
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import ndtri, stdtrit

from impactcell.numerics import scatter_correlation
from impactcell.numerics.jit import compiled
from impactcell.numerics.scatter_correlation import Variogram, variance_over_differences
from impactcell.records import Samples
from impactcell.tracking.wear_batch import declared_std_calibration

CLIP = 2.5
"""Standard deviations at which a difference is winsorised, as in the filter."""
_DENSITY = math.exp(-0.5 * CLIP**2) / math.sqrt(2.0 * math.pi)
"""Of a standard normal at `CLIP`."""
_INSIDE = math.erf(CLIP / math.sqrt(2.0))
"""Probability of a standard normal within `CLIP`."""
CONSISTENCY = _INSIDE - 2.0 * CLIP * _DENSITY + CLIP**2 * (1.0 - _INSIDE)
"""E min(e^2, CLIP^2) of a standard normal e: what winsorising leaves of the variance."""
MEDIAN_CHI_SQUARE = 0.4549
"""Median of a squared standard normal."""
UNSCALED = 11.0
"""Differences with which a guessed scale is good enough to know an outlier."""
ROUGH_BIAS = 1.25
"""Factor by which outliers may raise the winsorised factor; those in 2 % of the differences do by 1.11."""
MEMORY = 5000.0
"""Cycles after which the factor forgets."""
DECLARED_WEIGHT = 10.0
"""Differences that a declared standard deviation counts for."""
GUESSED_RELATIVE_STD = 0.01
"""Standard deviation where none was ever declared, of the value itself."""
GUESS_WEIGHT = 0.2
"""Differences that a guess counts for: values may be nearly the same by chance."""
DEGREES_PER_DIFFERENCE = 2.0 / 3.0
"""Degrees of freedom of a variance from n successive differences, over n (von Neumann 1941, Ann. Math. Stat.
12:367): neighbours share an estimate."""
UPPER = 0.975
"""Probability below the upper end of a 95 % interval."""
FEWEST_DIFFERENCES = 2.0
"""For fewer a guessed scale is no more in doubt: Student's interval would have no end."""
CONTRADICTED = 2.0
"""A factor beyond this, or below its inverse, says that the declared scale is no guide."""
ITERATIONS = 30
"""Of the expectation-maximisation: within 0.3 % of its end for 60 values with 5 % outliers."""
SMALLEST_GUESS = 1e-6
"""Guessed standard deviations do not fall below this, mu_s: nor does any estimate's."""
SMALLEST_FACTOR = 1e-6
"""Factors do not fall below this, so that identical values divide by no zero."""
WATCHED = 200.0
"""Differences over which it is watched whether the factor still holds."""
LATEST = 20.0
"""Differences from which it begins anew where it does not."""
GROWTH = 1e-5
"""Probability, a cycle, that the scatter grows, before it ever has. A step of 3 standard deviations looks
like it for two or three cycles: with 1e-4 it takes 3 % longer to find, with 1e-3 a fifth."""
CHANGED = 0.4
"""How far the mean winsorised square of `WATCHED` differences may be from one: five of its standard
deviations."""


@dataclass(frozen=True, slots=True, eq=False)
class NoiseScale:
    """Factor of the noise and what it was learned from.

    Attributes
    ----------
    factor : float
        kappa squared.
    weight : float
        Number of differences it rests on.
    winsorised_factor : float
        The winsorised one.
    usual_std : float
        Mean of those declared, over so many; nan before one was.
    last_value, last_std : float
        The estimate before, with the standard deviation that it declared; nan before the first.
    identical : int
        How many values in a row have been the same.
    guessed : bool
        No standard deviation was ever declared; the scale was guessed and is learned.
    exponent_posterior : ndarray
        How far the declared standard deviations are believed, see `declared_std_calibration`.
    watched_ratio, latest_ratio : float
        Mean winsorised squares of the last differences over the factor, of `WATCHED` and of `LATEST`.
    variogram : Variogram
        How an estimate's scatter goes with that of those before.
    rescalings : float
        How often the factor has begun anew, fading.
    """

    factor: float = 1.0
    weight: float = DECLARED_WEIGHT
    winsorised_factor: float = 1.0
    usual_std: float = math.nan
    last_value: float = math.nan
    last_std: float = math.nan
    identical: int = 0
    guessed: bool = False
    exponent_posterior: Samples = field(default_factory=declared_std_calibration.prior_posterior)
    watched_ratio: float = 1.0
    latest_ratio: float = 1.0
    variogram: Variogram = field(default_factory=Variogram)
    rescalings: float = 0.0


def identical_run(noise: NoiseScale, value: float) -> int:
    """Count how many values in a row have been the same, with this one."""
    return noise.identical + 1 if value == noise.last_value else 1


def update(
    noise: NoiseScale, value: float, declared: float, *, late: bool, other_batch: bool
) -> tuple[NoiseScale, float]:
    """Take in an estimate, and its difference from the one before into the factor unless it comes late.

    How differences go with one another is not learned across estimates of two batches.

    Returns
    -------
    noise : NoiseScale
    std : float
        Declared standard deviation, or in its place the usual one, or a guess to be corrected.
    """
    std, usual, weight, guessed = declared, noise.usual_std, noise.weight, noise.guessed
    if declared > 0.0 and math.isfinite(declared):
        usual = std if math.isnan(usual) else usual + (std - usual) / (weight + 1.0)
    elif not math.isnan(usual):
        std = usual
    else:
        std = usual = max(GUESSED_RELATIVE_STD * abs(value), SMALLEST_GUESS)
        weight, guessed = GUESS_WEIGHT, True
    identical = identical_run(noise, value)
    if late:
        return replace(noise, weight=weight, usual_std=usual, guessed=guessed, identical=identical), std
    factors, posterior = (noise.factor, noise.winsorised_factor), noise.exponent_posterior
    watched, latest = noise.watched_ratio, noise.latest_ratio
    # values that have not differed yet say nothing of how they scatter: a guess stays
    if not (math.isnan(noise.last_value) or (guessed and weight < 1.0 and identical > 1)):
        weight = min(weight + 1.0, MEMORY)
        factors, posterior = _learned_factors(noise, value, (std, usual), weight, guessed=guessed)
        watched, latest = _watched_ratios(noise, value, (std, usual))
    factor, winsorised_factor = factors
    calibrated = math.sqrt(noise.factor) * declared_std_calibration.calibrated_std(posterior, std, usual)
    before = scatter_correlation.begun_anew(noise.variogram) if other_batch else noise.variogram
    variogram = scatter_correlation.update(before, value, calibrated)
    learned = replace(
        noise,
        factor=factor,
        weight=weight,
        winsorised_factor=winsorised_factor,
        usual_std=usual,
        last_value=value,
        last_std=std,
        identical=identical,
        guessed=guessed,
        exponent_posterior=posterior,
        watched_ratio=watched,
        latest_ratio=latest,
        variogram=variogram,
        rescalings=noise.rescalings * (1.0 - 1.0 / MEMORY),
    )
    has_changed = abs(watched - 1.0) > CHANGED and weight > WATCHED
    return (rescaled(learned, latest) if has_changed else learned), std


def _variance_of_difference(noise: NoiseScale, stds: tuple[float, float]) -> float:
    """Variance of an estimate's difference from the one before, before the factor."""
    (std, usual), posterior = stds, noise.exponent_posterior
    return float(
        declared_std_calibration.calibrated_std(posterior, std, usual) ** 2
        + declared_std_calibration.calibrated_std(posterior, noise.last_std, usual) ** 2
    )


def _watched_ratios(noise: NoiseScale, value: float, stds: tuple[float, float]) -> tuple[float, float]:
    """Take a difference into both means of winsorised squares over the factor, one where it holds."""
    scale = noise.winsorised_factor * _variance_of_difference(noise, stds)
    ratio = min((value - noise.last_value) ** 2 / scale, CLIP**2) / CONSISTENCY
    return (
        noise.watched_ratio + (ratio - noise.watched_ratio) / WATCHED,
        noise.latest_ratio + (ratio - noise.latest_ratio) / LATEST,
    )


def _learned_factors(
    noise: NoiseScale, value: float, stds: tuple[float, float], weight: float, *, guessed: bool
) -> tuple[tuple[float, float], Samples]:
    """Learn from the difference of an estimate from the one before: both factors, and the exponents.

    `stds` are the estimate's and the usual one; the scale rests on `weight` differences with this one.
    """
    (std, usual), posterior, square = stds, noise.exponent_posterior, (value - noise.last_value) ** 2
    squared = square / _variance_of_difference(noise, stds)
    if guessed and weight < UNSCALED:
        # nothing to judge outliers by yet: the plain mean
        factor = max(noise.factor + (squared - noise.factor) / weight, SMALLEST_FACTOR)
        return (factor, factor), posterior
    clipped = min(squared, CLIP**2 * noise.winsorised_factor) / CONSISTENCY
    winsorised_factor = max(
        noise.winsorised_factor + (clipped - noise.winsorised_factor) / weight, SMALLEST_FACTOR
    )
    weighted = squared * declared_std_calibration.outlier_weight(squared, noise.factor)
    factor = max(
        noise.factor + (weighted - noise.factor) / weight, winsorised_factor / ROUGH_BIAS, SMALLEST_FACTOR
    )
    usual_square = square / (2.0 * noise.factor * usual**2)
    posterior = declared_std_calibration.update(posterior, usual_square, std, noise.last_std, usual, weight)
    return (factor, winsorised_factor), posterior


def variance(noise: NoiseScale, std: float) -> float:
    """Variance of an estimate that declares `std`; wider while a guessed scale rests on few differences."""
    calibrated = declared_std_calibration.calibrated_std(noise.exponent_posterior, std, noise.usual_std)
    return float(_believed_factor(noise) * calibrated**2)


def is_rough(noise: NoiseScale) -> bool:
    """Whether the scale is guessed, and rests on too few differences to know an outlier by it."""
    return noise.guessed and noise.weight < UNSCALED


def _believed_factor(noise: NoiseScale) -> float:
    """Give the factor of the variance; of a guessed scale so much wider as Student's interval is."""
    factor = noise.factor * variance_over_differences(noise.variogram.correlation)
    if not noise.guessed:
        return factor
    degrees = DEGREES_PER_DIFFERENCE * max(noise.weight, FEWEST_DIFFERENCES)
    return factor * float((stdtrit(degrees, UPPER) / ndtri(UPPER)) ** 2)


def rescaled(noise: NoiseScale, ratio: float) -> NoiseScale:
    """Begin the factor anew where the variance is so many times what it was."""
    return replace(
        noise,
        factor=max(ratio * noise.factor, SMALLEST_FACTOR),
        winsorised_factor=max(ratio * noise.winsorised_factor, SMALLEST_FACTOR),
        weight=LATEST,
        watched_ratio=1.0,
        latest_ratio=1.0,
        rescalings=noise.rescalings + 1.0,
    )


def log_odds_of_growth(noise: NoiseScale) -> float:
    """Of a scatter that grows, a cycle: the more, the more often the factor has begun anew."""
    return math.log(GROWTH + noise.rescalings / MEMORY)


def usual_variance(noise: NoiseScale) -> float:
    """Variance of a usual estimate."""
    return noise.factor * variance_over_differences(noise.variogram.correlation) * noise.usual_std**2


def variances(noise: NoiseScale, stds: Samples) -> Samples:
    """Variances of the estimates of a history by what is now known of their noise, each as `variance`."""
    calibrated = declared_std_calibration.calibrated_stds(noise.exponent_posterior, stds, noise.usual_std)
    return _believed_factor(noise) * calibrated**2


def scale_change(noise: NoiseScale, since: NoiseScale, stds: Samples) -> tuple[float, float]:
    """Factors, at least one, by which variances of these estimates have moved together, and apart (rms)."""
    ratios = np.log(variances(noise, stds) / variances(since, stds))
    return math.exp(abs(np.mean(ratios))), math.exp(np.std(ratios))


def refit(noise: NoiseScale, values: Samples, stds: Samples) -> NoiseScale:
    """Fit the factor to all of the first values at once: from a wrong one it takes long to come up."""
    if is_rough(noise):
        # its plain mean is all there is
        return noise
    unscaled = declared_std_calibration.calibrated_stds(noise.exponent_posterior, stds, noise.usual_std) ** 2
    squared = np.diff(values) ** 2 / (unscaled[1:] + unscaled[:-1])
    # by the median, which outliers hardly move
    start = max(float(np.median(squared)) / MEDIAN_CHI_SQUARE, SMALLEST_FACTOR)
    factor = _maximum_likelihood_factor(squared, start, 0.0 if noise.guessed else DECLARED_WEIGHT)
    if not 1.0 / CONTRADICTED < factor < CONTRADICTED:
        # what was declared is plainly wrong, and is no longer to weigh against the data
        factor = _maximum_likelihood_factor(squared, start, 0.0)
    return replace(noise, factor=factor, winsorised_factor=factor)


@compiled
def _maximum_likelihood_factor(squared: Samples, factor: float, prior_weight: float) -> float:
    """Fit the factor to squared differences by EM, with `prior_weight` differences at a factor of one."""
    for _ in range(ITERATIONS):
        total = 0.0
        for square in squared:
            total += square * declared_std_calibration.outlier_weight(square, factor)
        factor = max((prior_weight + total) / (prior_weight + len(squared)), SMALLEST_FACTOR)
    return factor
