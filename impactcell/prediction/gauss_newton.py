"""The one loop of these fits: Gauss-Newton, damped after Levenberg and Marquardt where a step does harm."""

import math
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from impactcell.errors import PhysicsError
from impactcell.numerics.jit import compiled
from impactcell.records import Samples

RAISED_DAMPING = 1e-2
"""Damping, over the diagonal of the curvature, after the first step that is refused: a hundredth of it hardly
turns the step. It is raised and lowered by factors of ten, as Marquardt (1963) does."""
MAX_DAMPING = 1e8
"""Damping beyond which a step is rounding of a double."""
STALLED_STEPS = 15
"""Steps in a row that together gain nothing, damped and free, after which a minimum lies on a kink: a wall on
one side refuses the steps that the other asks for. Two rounds of raised and lowered damping."""
NEAR_ENOUGH = 0.5
"""Posterior standard deviations from a point to its quadratic's minimum below which a wall between the two, a
sample that a jump of the force would have to cross, makes no difference."""
FREE_DAMPING = 1e-3
"""Damping up to which a step's length tells how far the minimum is: it is then shorter by a thousandth."""


class Point(Protocol):
    """Where a fit stands."""

    @property
    def theta(self) -> Samples:
        """Parameters."""

    @property
    def cost(self) -> float:
        """Half the sum of squares."""


PointT = TypeVar("PointT", bound=Point)


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One step of a fit.

    Attributes
    ----------
    theta : ndarray
        Parameters after it, held within what the linear model is believed over.
    length : float
        Squared, of the whole step, in variances of the posterior; nan where the curvature is not positive.
    covariance : ndarray, shape (p, p)
        Inverse of the curvature where the step began.
    """

    theta: Samples
    length: float
    covariance: Samples


class LeastSquares(Protocol[PointT]):
    """What is fitted: residuals that are linear near a point."""

    def linearise(self, theta: Samples) -> PointT:
        """Take residuals and derivatives at `theta`; `PhysicsError` where the model has none there."""

    def step(self, start: PointT, damping: float) -> Step:
        """Solve the linear problem at a point, its curvature's diagonal raised by the share `damping`."""

    def noise(self, at: PointT) -> float:
        """Mean square of the residuals over what they were divided by: what tolerances are in units of."""


@dataclass(frozen=True, slots=True)
class StopRule:
    """When a fit ends.

    Attributes
    ----------
    max_steps : int
        Steps, refused ones included, after which it has not converged.
    length : float
        Of a step, in posterior standard deviations, below which the fit is at its minimum. This and the
        costs are for residuals of the size of the noise; where they are larger, so are these.
    cost : float
        Change of half a sum of squares that means nothing: a kink that passes a sample makes Gauss-Newton
        go to and fro by less.
    refused_cost : float
        The same of a step that was refused: where the smaller ones after it mean nothing either, a kink
        passes samples, and the minimum lies within less than half a standard deviation.
    """

    max_steps: int
    length: float
    cost: float
    refused_cost: float


def fit(problem: LeastSquares[PointT], initial_guess: Samples, stop: StopRule) -> tuple[PointT, Step, bool]:
    """Find the minimum of a problem.

    Returns
    -------
    minimum : Point
        Where the fit ended.
    step : Step
        The last one that was solved for, from `minimum` or to it.
    converged : bool
        False where the steps came to an end before the minimum did.

    Raises
    ------
    PhysicsError
        The model has no residuals at the initial guess.
    """
    best = problem.linearise(initial_guess)
    damping, refused, distance = 0.0, math.inf, math.inf
    costs: list[float] = []
    for _ in range(stop.max_steps):
        step = problem.step(best, damping)
        if not math.isfinite(step.length):
            break
        noise = problem.noise(best)
        if damping <= FREE_DAMPING:
            distance = step.length
        costs.append(best.cost)
        if len(costs) > STALLED_STEPS and costs[-STALLED_STEPS - 1] - best.cost < stop.cost * noise:
            return best, step, True
        if step.length < stop.length**2 * noise and damping <= FREE_DAMPING:
            return best, step, True
        try:
            trial = problem.linearise(step.theta)
            cost = trial.cost
        except PhysicsError:
            trial, cost = best, math.inf
        if cost <= best.cost + stop.cost * noise:
            gain = best.cost - cost
            is_at_rest = abs(gain) < stop.cost * noise and (
                damping <= RAISED_DAMPING or refused < stop.refused_cost * noise
            )
            refused = math.inf if gain > stop.refused_cost * noise else refused
            best = trial
            if is_at_rest:
                return best, step, True
            damping = 0.0 if damping < RAISED_DAMPING else 0.1 * damping
        else:
            refused = cost - best.cost
            damping = max(10.0 * damping, RAISED_DAMPING)
            if damping > MAX_DAMPING:
                return best, step, distance < NEAR_ENOUGH**2 * noise
    return best, step, False


@compiled
def step_within(step: Samples, covariance: Samples, low: Samples, high: Samples) -> Samples:
    """Give the step to the quadratic's minimum within bounds, `low` <= 0 <= `high`, component by component.

    Of those beyond their bounds the farthest, in its standard deviations, is held there, and the others
    follow as the mean of a Gaussian follows what is known of one component, until none is beyond. Cut off
    component by component the others would belong to a step that is not taken.
    """
    step, covariance = step.copy(), covariance.copy()
    for _ in range(len(step)):
        farthest, held = 0.0, -1
        for j in range(len(step)):
            beyond = max(step[j] - high[j], low[j] - step[j])
            if beyond > 0.0 and covariance[j, j] > 0.0 and beyond > farthest * math.sqrt(covariance[j, j]):
                farthest, held = beyond / math.sqrt(covariance[j, j]), j
        if held < 0:
            break
        bound = min(max(step[held], low[held]), high[held])
        along = covariance[held] / covariance[held, held]
        step += along * (bound - step[held])
        covariance -= np.outer(along, covariance[held].copy())
        covariance[held], covariance[:, held], step[held] = 0.0, 0.0, bound
    return np.minimum(np.maximum(step, low), high)
