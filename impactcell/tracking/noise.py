"""How noisy the estimates really are: the factor between their own standard deviation and the data's.

The factor comes from differences of successive estimates, which neither wear nor a batch step moves:
E (z_n - z_{n-1})^2 = kappa^2 (s_n^2 + s_{n-1}^2). Squares are winsorised against outliers and batch steps.
"""

import math
from dataclasses import dataclass, replace

CLIP = 2.5
# E min(e^2, c^2) of a standard normal e, c = 2.5: what winsorising takes away
_DENSITY = math.exp(-0.5 * CLIP**2) / math.sqrt(2.0 * math.pi)
_INSIDE = math.erf(CLIP / math.sqrt(2.0))
CONSISTENCY = _INSIDE - 2.0 * CLIP * _DENSITY + CLIP**2 * (1.0 - _INSIDE)
MEMORY = 5000.0  # cycles after which the factor forgets
DECLARED_WEIGHT = 100.0  # differences that a declared standard deviation counts for
GUESSED_RELATIVE_STD = 0.01  # where no standard deviation was ever declared: of the value itself
SMALLEST_FACTOR = 1e-3


@dataclass(frozen=True, slots=True)
class Noise:
    """Factor of the noise and what it was learned from.

    Attributes
    ----------
    factor : float
        kappa squared.
    weight : float
        Number of differences it rests on.
    usual_std : float
        Declared standard deviation as it usually is; nan before one was declared.
    last_value, last_std : float
        The estimate before, with the declared standard deviation used for it; nan before the first.
    identical : int
        How many values in a row have been the same.
    guessed : bool
        No standard deviation was ever declared; the scale was guessed and is learned.
    """

    factor: float = 1.0
    weight: float = DECLARED_WEIGHT
    usual_std: float = math.nan
    last_value: float = math.nan
    last_std: float = math.nan
    identical: int = 0
    guessed: bool = False


def declared_std(noise: Noise, value: float, std: float) -> tuple[Noise, float]:
    """Find the standard deviation to go with a value: its own, the usual one, or a guess to be corrected."""
    if std > 0.0 and math.isfinite(std):
        usual = std if math.isnan(noise.usual_std) else noise.usual_std + 0.05 * (std - noise.usual_std)
        return replace(noise, usual_std=usual), std
    if not math.isnan(noise.usual_std):
        return noise, noise.usual_std
    guess = GUESSED_RELATIVE_STD * abs(value)
    return replace(noise, usual_std=guess, weight=1.0, guessed=True), guess


def learn(noise: Noise, value: float, std: float) -> Noise:
    """Take one more difference into the factor."""
    if math.isnan(noise.last_value):
        return replace(noise, last_value=value, last_std=std)
    squared = (value - noise.last_value) ** 2 / (std**2 + noise.last_std**2)
    clipped = min(squared, CLIP**2 * noise.factor) / CONSISTENCY
    weight = min(noise.weight + 1.0, MEMORY)
    factor = max(noise.factor + (clipped - noise.factor) / weight, SMALLEST_FACTOR)
    return replace(noise, factor=factor, weight=weight, last_value=value, last_std=std)


def variance(noise: Noise, std: float) -> float:
    """Variance of an estimate that declares `std`; wider while a guessed scale rests on few differences."""
    doubt = 1.0 + 4.0 / noise.weight if noise.guessed else 1.0
    return noise.factor * doubt * std**2


def count_identical(noise: Noise, value: float) -> Noise:
    """Count how many values in a row have been the same."""
    return replace(noise, identical=noise.identical + 1 if value == noise.last_value else 1)
