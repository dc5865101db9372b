"""Posterior of a tap's parameters: a Gaussian on either side of the kink where breakaway becomes immediate.

With theta = ln(mu_k, mu_k/mu_s, k, b) the side is told by a linear form, z = ln(mu_s m g / (b v)): above 0
the part sticks until the contact force reaches mu_s m g, below 0 the damper's first force moves it at once
and the data do not depend on mu_s. The log posterior is smooth on either side and continuous, but its slope
jumps at z = 0; each side is a quadratic cut off there.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr

from impactcell.records import Samples


@dataclass(frozen=True, slots=True, eq=False)
class TruncatedGaussian:
    """A Gaussian cut off at z = 0.

    Attributes
    ----------
    mean : ndarray, shape (p,)
        Where the quadratic has its minimum, on whichever side of the kink.
    covariance : ndarray, shape (p, p)
    cost : float
        Half the sum of squares, data and prior, at `mean`.
    log_volume : float
        Logarithm of the determinant of the covariance of what was fitted.
    sign : int
        +1: holds for z > 0; -1: for z < 0; 0: everywhere.
    """

    mean: Samples
    covariance: Samples
    cost: float
    log_volume: float
    sign: int


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """Mixture of cut-off Gaussians.

    Attributes
    ----------
    sides : tuple of TruncatedGaussian
    weights : ndarray
        Probability of each side.
    form : ndarray, shape (p,)
    offset : float
        z = form @ theta + offset.
    """

    sides: tuple[TruncatedGaussian, ...]
    weights: Samples
    form: Samples
    offset: float

    def moments(self, of: Samples) -> tuple[float, float]:
        """Mean and standard deviation of the linear form `of` @ theta."""
        means, variances = [], []
        for side in self.sides:
            mean, variance = float(of @ side.mean), float(of @ side.covariance @ of)
            if side.sign:
                centre, spread, slope = self._along(side, of)
                shift, shrink = _truncated_moments(side.sign * centre / spread)
                mean += slope * side.sign * spread * shift
                variance -= slope**2 * spread**2 * (1.0 - shrink)
            means.append(mean)
            variances.append(max(variance, 0.0))
        mean = float(self.weights @ np.array(means))
        second = self.weights @ (np.array(variances) + (np.array(means) - mean) ** 2)
        return mean, math.sqrt(float(second))

    def shared_std(self, of: Samples, shared: Samples) -> float:
        """Give the part of the standard deviation of `of` @ theta that is of wrong priors, not of noise.

        In least squares with covariance C and a prior of precision P an error e of the prior's mean moves the
        estimate by C P e. With e as wide as the prior that is C P C; the rest, C - C P C, is the noise's.

        Parameters
        ----------
        of : ndarray, shape (p,)
        shared : ndarray, shape (p,)
            One over the standard deviation of each prior that other taps have as well; 0 for all else.
        """
        along = [shared * (side.covariance @ of) for side in self.sides]
        return math.sqrt(sum(w * float(one @ one) for w, one in zip(self.weights, along, strict=True)))

    def _along(self, side: TruncatedGaussian, of: Samples) -> tuple[float, float, float]:
        """Mean and spread of z on one side, and how the linear form follows z."""
        centre = float(self.form @ side.mean) + self.offset
        variance = float(self.form @ side.covariance @ self.form)
        return centre, math.sqrt(variance), float(of @ side.covariance @ self.form) / variance


def mixture(sides: tuple[TruncatedGaussian, ...], form: Samples, offset: float) -> Posterior:
    """Weigh the sides by the mass of each cut-off Gaussian."""
    logs = []
    for side in sides:
        mass = 0.5 * side.log_volume - side.cost
        if side.sign:
            centre = float(form @ side.mean) + offset
            mass += float(log_ndtr(side.sign * centre / math.sqrt(float(form @ side.covariance @ form))))
        logs.append(mass)
    weights = np.exp(np.array(logs) - max(logs))
    return Posterior(sides, weights / weights.sum(), form, offset)


def _truncated_moments(beta: float) -> tuple[float, float]:
    """Shift of the mean and factor of the variance of a standard normal cut off below -beta."""
    hazard = math.exp(-0.5 * beta * beta - 0.5 * math.log(2.0 * math.pi) - float(log_ndtr(beta)))
    return hazard, max(1.0 - hazard * (hazard + beta), 0.0)
