"""Gauss-Newton descent of a tap's posterior on one side of the kink of immediate breakaway."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from impactcell.compiled import compiled
from impactcell.errors import PhysicsError
from impactcell.prediction.posterior import Side
from impactcell.prediction.response import JUST_STICKING, PARAMETERS, RATIO, Response
from impactcell.records import Samples

Indices = NDArray[np.intp]

MOST_STEPS = 25
SETTLED = 0.02
"""Length of a step, in posterior standard deviations, below which the fit is at its minimum. This and
`NO_GAIN` are for residuals of the size of the noise; where they are larger, so are these."""
LONGEST_IN_STD = 4.0
"""Longest step, in standard deviations of the prior: farther away the linear model says nothing."""
NO_GAIN = 0.005
"""Change of half a sum of squares that means nothing: a kink that passes a sample makes Gauss-Newton go to
and fro by less."""


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """Prior in theta: mean, and one over its standard deviation; 0 where nothing is known.

    Attributes
    ----------
    mean, weight : ndarray, shape (4,)
    free : ndarray of int
        Indices of what is fitted.
    """

    mean: Samples
    weight: Samples
    free: Indices

    def cost(self, theta: Samples) -> float:
        """Half the sum of squares of the prior."""
        return 0.5 * float(np.sum((self.weight[self.free] * (theta - self.mean)[self.free]) ** 2))


@dataclass(frozen=True, slots=True, eq=False)
class Minimum:
    """Where a descent ended, and the linear model there.

    Attributes
    ----------
    theta : ndarray, shape (4,)
    side : int
    residual : ndarray, shape (n,)
    normal : ndarray, shape (p, p)
        Product of the derivative by what is fitted with itself.
    slope : ndarray, shape (p,)
        Product of that derivative with the residual.
    cost : float
        Half the sum of squares, data and prior.
    settled : bool
        False where the steps came to an end before the minimum did.
    """

    theta: Samples
    side: int
    residual: Samples
    normal: Samples
    slope: Samples
    cost: float
    settled: bool = True

    @property
    def chi2(self) -> float:
        """Sum of squares of the data's residuals."""
        return float(self.residual @ self.residual)

    def as_side(self, known: Belief, misfit: float = 1.0) -> Side:
        """Give the quadratic about the minimum, the data's weight divided by `misfit` squared."""
        free = known.free
        inverse, step, beyond, log_determinant = _completed(
            self.normal, self.slope, known.weight[free] ** 2, (self.theta - known.mean)[free], misfit
        )
        mean = self.theta.copy()
        mean[free] += step
        covariance = np.zeros((PARAMETERS, PARAMETERS))
        covariance[free[:, None], free] = inverse
        return Side(mean, covariance, 0.5 * (self.chi2 / misfit**2 + beyond), -log_determinant, self.side)


@compiled
def _completed(
    normal: Samples, slope: Samples, prior: Samples, away: Samples, misfit: float
) -> tuple[Samples, Samples, float, float]:
    """Complete the square about a point that lies `away` from the prior's mean.

    Returns
    -------
    inverse : ndarray, shape (p, p)
        Of the curvature of data and prior.
    step : ndarray, shape (p,)
        To the quadratic's minimum.
    beyond : float
        Twice the cost there, without what the data cost here.
    log_determinant : float
        Of the curvature.
    """
    curvature = normal / misfit**2 + np.diag(prior)
    gradient = slope / misfit**2 + prior * away
    inverse = np.linalg.inv(curvature).astype(np.float64)
    step = -(inverse @ gradient)
    beyond = np.sum(prior * away**2) + np.sum(gradient * step)
    _, log_determinant = np.linalg.slogdet(curvature)
    return inverse, step, float(beyond), float(log_determinant)


@compiled
def _step(
    normal: Samples, slope: Samples, prior: Samples, away: Samples, damping: float
) -> tuple[Samples, float]:
    """Gauss-Newton step, its diagonal damped after Levenberg and Marquardt, and its length in variances."""
    curvature = normal + np.diag(prior)
    damped = curvature + damping * np.diag(np.diag(curvature))
    step = -np.linalg.solve(damped, slope + prior * away).astype(np.float64)
    return step, float(np.sum(step * (curvature @ step)))


def descend(response: Response, known: Belief, start: Samples, side: int) -> Minimum:
    """Find the minimum of data and prior, with the model of one side continued across the kink.

    Below the kink (`side` -1) the model is that of immediate breakaway. Above it (`side` +1) the residuals
    are continued linearly along mu_k/mu_s from the kink.
    """
    free, prior = known.free, known.weight[known.free] ** 2
    longest = np.minimum(0.5, LONGEST_IN_STD / np.maximum(known.weight[free], 1e-12))
    best = _at(response, known, start, side)
    damping = 0.0
    for _ in range(MOST_STEPS):
        step, length = _step(best.normal, best.slope, prior, (best.theta - known.mean)[free], damping)
        if not math.isfinite(length):
            break
        noise = max(2.0 * best.cost / response.size, 1.0)
        if length < SETTLED**2 * noise and damping <= 1e-3:
            return best
        moved = best.theta.copy()
        moved[free] += np.minimum(np.maximum(step, -longest), longest)
        try:
            tried = _at(response, known, moved, side)
        except PhysicsError:
            tried = replace(best, cost=math.inf)
        if tried.cost <= best.cost + NO_GAIN * noise:
            settled = abs(tried.cost - best.cost) < NO_GAIN * noise and damping <= 1e-2
            best = tried
            if settled:
                return best
            damping = 0.0 if damping < 1e-2 else 0.1 * damping
        else:
            damping = max(10.0 * damping, 1e-2)
            if damping > 1e8:
                break
    return replace(best, settled=False)


def _at(response: Response, known: Belief, theta: Samples, side: int) -> Minimum:
    """Give the linear model at `theta`."""
    residual, jacobian = _linear(response, theta, side)
    by_free = jacobian[:, known.free]
    cost = 0.5 * float(residual @ residual) + known.cost(theta)
    return Minimum(theta, side, residual, by_free.T @ by_free, by_free.T @ residual, cost)


def _linear(response: Response, theta: Samples, side: int) -> tuple[Samples, Samples]:
    """Residuals and their derivative, those above the kink continued linearly below it."""
    at = theta
    if side > 0 and (below := response.kink(theta) - JUST_STICKING) < 0.0:
        at = theta.copy()
        at[RATIO] += below
    residual, jacobian = response.linear(at, side)
    return residual + jacobian[:, RATIO] * (theta[RATIO] - at[RATIO]), jacobian
