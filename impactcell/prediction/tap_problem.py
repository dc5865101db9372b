"""Least squares of one tap: data and prior, on one side of the kink of immediate breakaway."""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.prediction import gauss_newton
from impactcell.prediction.block_residuals import Linearisation
from impactcell.prediction.gauss_newton import Step, StopRule, step_within
from impactcell.prediction.linearised_model import (
    FARTHEST,
    JUST_STICKING,
    PARAMETERS,
    POSITION_SCALE,
    RATIO,
    LinearisedModel,
)
from impactcell.prediction.posterior import TruncatedGaussian
from impactcell.records import Samples

STOP = StopRule(max_steps=50, length=0.02, cost=0.005, refused_cost=0.1)
"""When the fit of one tap ends: an estimate off by 0.02 of its standard deviation is off by nothing."""
MAX_STEP_STD = 4.0
MAX_STEP = np.append(np.full(POSITION_SCALE, 0.5), MAX_STEP_STD)
"""Longest step, in standard deviations of the prior and in theta: beyond, the linear model says nothing.
In the scale of the position it is exact; a step cut off there would leave mu_k without what it follows."""


@dataclass(frozen=True, slots=True, eq=False)
class GaussianPrior:
    """Prior in theta: mean, and one over its standard deviation; 0 where nothing is known.

    Attributes
    ----------
    mean, weight : ndarray, shape (p,)
    """

    mean: Samples
    weight: Samples

    def cost(self, theta: Samples) -> float:
        """Half the sum of squares of the prior."""
        deviation = self.weight * (theta - self.mean)
        return 0.5 * float(deviation @ deviation)


@dataclass(frozen=True, slots=True, eq=False)
class Minimum:
    """Where a descent ended, and the linear model there.

    Attributes
    ----------
    theta : ndarray, shape (p,)
    side : int
    linear : Linearisation
    cost : float
        Half the sum of squares, data and prior.
    converged : bool
        False where the steps came to an end before the minimum did.
    """

    theta: Samples
    side: int
    linear: Linearisation
    cost: float
    converged: bool = True

    @property
    def residual(self) -> Samples:
        """The data's residuals, shape (n,)."""
        return self.linear.residual

    @property
    def chi2(self) -> float:
        """Sum of squares of the data's residuals."""
        return self.linear.chi2

    @property
    def misfit(self) -> float:
        """Give the RMS of what is measured over its standard deviation, 1 where the model is right.

        Beside the residuals first contact, mass, velocity and scales, which were measured as well: by some
        standard deviations of each a model makes up for much of what it lacks.
        """
        off = self.theta[PARAMETERS:]
        return math.sqrt((self.chi2 + float(off @ off)) / max(len(self.residual) - PARAMETERS, 1))

    def truncated(self, prior: GaussianPrior, misfit: float = 1.0) -> TruncatedGaussian:
        """Give the quadratic about the minimum, the data's weight divided by `misfit` squared.

        Raises
        ------
        LinAlgError
            The data and the prior do not determine it.
        """
        deviation = self.theta - prior.mean
        step, covariance, length, log_determinant = _solve_step(
            self.linear.normal, self.linear.slope, prior.weight, deviation, misfit, 0.0
        )
        if not math.isfinite(log_determinant):
            raise np.linalg.LinAlgError("the curvature is not positive")
        cost = 0.5 * (self.chi2 / misfit**2 - length) + prior.cost(self.theta)
        return TruncatedGaussian(self.theta + step, covariance, cost, -log_determinant, self.side)


@compiled
def _solve_step(
    normal: Samples,
    slope: Samples,
    weight: Samples,
    deviation: Samples,
    misfit: float,
    damping: float,
) -> tuple[Samples, Samples, float, float]:
    """Gauss-Newton step from a point at a `deviation` from the prior's mean.

    The diagonal is damped after Levenberg and Marquardt, the data's weight divided by `misfit` squared.

    Returns
    -------
    step : ndarray, shape (p,)
        To the quadratic's minimum where nothing is damped.
    inverse : ndarray, shape (p, p)
        Of the damped curvature.
    length : float
        Of the step, in variances. Without damping also twice what the cost falls by.
    log_determinant : float
        Of the damped curvature; nan where it is not positive.
    """
    size = len(slope)
    curvature, factor = np.empty((size, size)), np.zeros((size, size))
    gradient = np.empty(size)
    log_determinant = 0.0
    for j in range(size):
        gradient[j] = slope[j] / misfit**2 + weight[j] ** 2 * deviation[j]
        for k in range(size):
            curvature[j, k] = normal[j, k] / misfit**2
        curvature[j, j] += weight[j] ** 2
    for j in range(size):  # Cholesky's factor L
        for k in range(j + 1):
            pivot = curvature[j, k] * (1.0 + damping if j == k else 1.0)
            for m in range(k):
                pivot -= factor[j, m] * factor[k, m]
            factor[j, k] = math.sqrt(pivot) if j == k else pivot / factor[k, k]
        log_determinant += 2.0 * math.log(factor[j, j])
    columns = np.zeros((size, size))
    for j in range(size):  # of the inverse of L
        columns[j, j] = 1.0 / factor[j, j]
        for k in range(j + 1, size):
            for m in range(j, k):
                columns[k, j] -= factor[k, m] * columns[m, j]
            columns[k, j] /= factor[k, k]
    inverse, step = np.zeros((size, size)), np.zeros(size)
    for j in range(size):
        for k in range(size):
            for m in range(max(j, k), size):
                inverse[j, k] += columns[m, j] * columns[m, k]
            step[j] -= inverse[j, k] * gradient[k]
    length = 0.0
    for j in range(size):
        for k in range(size):
            length += step[j] * curvature[j, k] * step[k]
    return step, inverse, length, log_determinant


@dataclass(frozen=True, slots=True, eq=False)
class TapProblem:
    """Data and prior of a tap, with the model of one side continued across the kink.

    Below the kink (`side` -1) the model is that of immediate breakaway. Above it (`side` +1) the residuals
    are continued linearly along mu_k/mu_s from the kink.

    Attributes
    ----------
    model : LinearisedModel
    prior : GaussianPrior
    side : int
    """

    model: LinearisedModel
    prior: GaussianPrior
    side: int

    def fit(self, initial_guess: Samples) -> Minimum:
        """Find the minimum."""
        minimum, _, converged = gauss_newton.fit(self, initial_guess, STOP)
        return minimum if converged else replace(minimum, converged=False)

    def linearise(self, theta: Samples) -> Minimum:
        """Give the linear model at `theta`, that above the kink continued linearly below it."""
        at, beyond = theta, 0.0
        if self.side > 0 and (below := self.model.kink_coordinate(theta) - JUST_STICKING) < 0.0:
            at, beyond = theta.copy(), -below
            at[RATIO] += below
        linear = self.model.linearise(at, self.side, beyond)
        return Minimum(theta, self.side, linear, 0.5 * linear.chi2 + self.prior.cost(theta))

    def step(self, start: Minimum, damping: float) -> Step:
        """Solve the linear problem at `start`."""
        linear, prior = start.linear, self.prior
        step, covariance, length, _ = _solve_step(
            linear.normal, linear.slope, prior.weight, start.theta - prior.mean, 1.0, damping
        )
        longest = np.minimum(MAX_STEP[: len(step)], MAX_STEP_STD / np.maximum(prior.weight, 1e-12))
        low, high = -longest, longest
        record, farthest = start.theta[PARAMETERS:], FARTHEST[: len(step) - PARAMETERS]
        low[PARAMETERS:] = np.minimum(np.maximum(low[PARAMETERS:], -farthest - record), 0.0)
        high[PARAMETERS:] = np.maximum(np.minimum(high[PARAMETERS:], farthest - record), 0.0)
        return Step(start.theta + step_within(step, covariance, low, high), length, covariance)

    def noise(self, at: Minimum) -> float:
        """Mean square of the residuals, no less than that of noise."""
        return max(2.0 * at.cost / self.model.size, 1.0)
