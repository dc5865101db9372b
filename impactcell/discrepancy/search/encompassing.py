"""Does what an effect predicts occur in shots that it was not fitted to? Regression of one on the other.

With e what a model leaves without an effect and c how the effect changes it, squares fall by
sum(e^2) - sum((e - c)^2) = sum(2 e c - c^2), which is above zero where the slope a = sum(e c)/sum(c^2) of e
on c is above one half: a test of forecasts against each other (Harvey, Leybourne & Newbold 1998). It asks how
well the change fits, not in how many shots, so that it also hears what acts in two shots of ten.
"""

import math
from dataclasses import dataclass

from scipy.stats import t as student

from impactcell.records import Samples

EQUAL = 0.5
"""Slope at which a model is as good with an effect as without."""


@dataclass(frozen=True, slots=True)
class Slope:
    """Slope of what is left without an effect on how the effect changes it.

    Attributes
    ----------
    value, std : float
    freedom : float
        Degrees of freedom of `std`.
    change : float
        Sum of the squared change: squares fall by (2 `value` - 1) of it.
    """

    value: float
    std: float
    freedom: float
    change: float

    @property
    def p_value(self) -> float:
        """Probability of such a slope where squares do not fall, one-sided."""
        if not self.change > 0.0:
            return 1.0
        return float(student.sf((self.value - EQUAL) / max(self.std, 1e-300), self.freedom))

    def fall(self, probability: float) -> float:
        """Quantile of how much the sum of squares falls."""
        if not self.change > 0.0:
            return 0.0
        return (
            2.0 * (self.value + float(student.ppf(probability, self.freedom)) * self.std) - 1.0
        ) * self.change


def acting_shots(change: Samples) -> float:
    """How many shots a change acts in: (sum c²)²/sum c⁴ of the shots' sums of squares, shape (n,).

    One where it is in a single shot, n where it is alike in all.
    """
    return float(change.sum() ** 2 / max(float((change**2).sum()), 1e-300))


def slope_of_factors(before: Samples, after: Samples) -> Slope:
    """Slope of friction factors, whose scatter is independent from shot to shot, shape (n,)."""
    change = before - after
    total = float(change @ change)
    freedom = max(len(before) - 1, 1)
    value = float(before @ change) / max(total, 1e-300)
    left = before - value * change
    return Slope(value, math.sqrt(float(left @ left) / freedom / max(total, 1e-300)), freedom, total)


def slope_of_traces(
    before: Samples, after: Samples, acting: float, correlated: float, pieces: float
) -> Slope:
    """Slope of traces [1 = noise floor] whose errors may be alike in all shots.

    The variance is that of noise and of a smooth error of the same sign in every shot that the change acts
    in: at most (1 + correlated) times their number.

    Parameters
    ----------
    before, after : ndarray, shape (N,)
    acting : float
        Shots in which it acts.
    correlated : float
        Mean square of the smooth error times its correlation length in samples [1 = noise floor squared].
    pieces : float
        Correlation lengths of a shot.
    """
    change = before - after
    total = float(change @ change)
    value = float(before @ change) / max(total, 1e-300)
    std = math.sqrt(max(acting, 1.0) * (1.0 + correlated) / max(total, 1e-300))
    return Slope(value, std, max(pieces - 1.0, 1.0), total)
