"""Least squares with every shot's own numbers eliminated inside every step.

Minimised is |r|² + sum (log f_i / s)²: the whitened residuals of all traces, and the spread s of the
friction factors about one; alike a velocity or a mass that is open, by what is told and the error of that.
Numbers that belong to one shot only (friction factor, initial speed, contact, settings, unknown mass) are
eliminated shot by shot, so that the system to solve is no larger than the shared parameters (variable
projection on a block-arrow matrix), and refitted after every trial step: without that fits stall.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.discrepancy.data import ShotSet
from impactcell.discrepancy.model.gauss_newton import gauss_newton
from impactcell.discrepancy.model.parameters import Coordinate
from impactcell.discrepancy.model.problem import FitState, Problem, total_cost
from impactcell.discrepancy.model.restarts import begin_again, centre_factors
from impactcell.discrepancy.model.shot_fits import (
    PINNED_SPREAD,
    fit_shot_parameters,
    initialise,
    normal_equations,
)
from impactcell.discrepancy.model.shot_parameters import ShotParameters
from impactcell.errors import DiscrepancyError
from impactcell.records import Samples


@dataclass(frozen=True, slots=True)
class FitPolicy:
    """Where a fit begins and when it ends; numbers found by trial.

    Attributes
    ----------
    first_spread : float
        Of the logarithm of the friction factors, where nothing is known of it: friction of clean parts
        repeats to some 3 %.
    wide_spread : float
        One that leaves the friction factors free, where they are all that is fitted.
    most_steps, tolerance : int, float
        Steps of a fit, and the change of the cost, in squared standard deviations, at which it ends.
    fewest_steps_to_restart : int
        Only a fit that may run this far is begun again where it came to rest short of its optimum.
    """

    first_spread: float = 0.03
    wide_spread: float = 1e3
    most_steps: int = 30
    tolerance: float = 0.02
    fewest_steps_to_restart: int = 10


POLICY = FitPolicy()
"""The policy in use."""


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A fitted model.

    Attributes
    ----------
    effects : tuple of str
    coordinates : tuple of Coordinate
    theta : ndarray, shape (p,)
        Coordinates at the optimum.
    shot_parameters : ShotParameters
    spread : float
        Standard deviation of the logarithm of the friction factors.
    residual : ndarray, shape (N,)
        Measured minus predicted, over the sensors' noise.
    """

    effects: tuple[str, ...]
    coordinates: tuple[Coordinate, ...]
    theta: Samples
    shot_parameters: ShotParameters
    spread: float
    residual: Samples

    def misfit(self, shots: ShotSet) -> Samples:
        """Squared residual of every shot, shape (n,)."""
        return np.add.reduceat(self.residual**2, shots.bounds[:-1])

    def log_likelihood(self, shots: ShotSet) -> Samples:
        """Log-likelihood of every shot but for constants, shape (n,): its traces, and its factor."""
        factor = (self.shot_parameters.log_factor / self.spread) ** 2 + 2.0 * math.log(self.spread)
        return -0.5 * (self.misfit(shots) + factor)

    @property
    def state(self) -> FitState:
        """Where the fit has come to rest."""
        cost = total_cost(self.residual, self.shot_parameters, self.spread)
        return FitState(self.theta, self.shot_parameters, self.spread, self.residual, cost)


def fit(
    problem: Problem,
    theta: Samples,
    shot_parameters: ShotParameters,
    *,
    spread: float = POLICY.first_spread,
    most_steps: int = POLICY.most_steps,
    tolerance: float = POLICY.tolerance,
) -> Fit:
    """Fit the shared coordinates and every shot's own numbers by damped Gauss-Newton steps.

    Parameters
    ----------
    problem : Problem
    theta : ndarray, shape (p,)
        Start, in coordinates.
    shot_parameters : ShotParameters
        Start of each shot's own numbers.
    spread : float
        First value of the factors' spread; it is fitted too.
    tolerance : float
        Change of the cost, in units of one squared standard deviation, at which a fit has converged.

    Raises
    ------
    DiscrepancyError
        The plant has no answer at the start.
    """
    state = problem.evaluate(np.clip(theta, *problem.bounds()), shot_parameters, spread)
    state = fit_shot_parameters(problem, state)
    if not state.cost < math.inf:
        raise DiscrepancyError(
            f"the plant with {', '.join(problem.effects) or 'no effect'} has no answer at the start"
        )
    state = gauss_newton(problem, centre_factors(problem, state), most_steps, tolerance)
    if most_steps >= POLICY.fewest_steps_to_restart:
        state = begin_again(problem, state, most_steps, tolerance)
    return Fit(
        problem.effects, problem.coordinates, state.theta, state.shot_parameters, state.spread, state.residual
    )


def fit_from(problem: Problem, model: Fit) -> Fit:
    """Fit a model to shots of which something is open that was not, from where it stands.

    Raises
    ------
    DiscrepancyError
        The plant has no answer there.
    """
    model_problem = problem.with_effects(model.effects)
    return fit(model_problem, model.theta, model.shot_parameters, spread=model.spread)


def refit_shot_parameters(problem: Problem, model: Fit) -> Fit:
    """Keep the shared parameters of `model` and fit only what every shot of `problem` has of its own."""
    factors = (0.0, -model.spread, model.spread)
    state = initialise(problem.with_effects(model.effects), model.theta, POLICY.wide_spread, factors)
    return replace(model, shot_parameters=state.shot_parameters, residual=state.residual)


def initial_shot_parameters(problem: Problem, theta: Samples) -> ShotParameters:
    """Fit what every shot has of its own from several starts; the best of them shot by shot."""
    return initialise(problem, theta, POLICY.first_spread).shot_parameters


def promised_fall(problem: Problem, model: Fit) -> float:
    """Fall of the cost that a full Gauss-Newton step inside the bounds promises; 0 at an optimum."""
    bound, state = problem.with_effects(model.effects), model.state
    H, g, _ = normal_equations(bound, *bound.linearise(state), state)
    lower, upper = bound.bounds()
    free = ~(((model.theta <= lower) & (g < 0.0)) | ((model.theta >= upper) & (g > 0.0)))
    return float(g[free] @ np.linalg.lstsq(H[np.ix_(free, free)], g[free], rcond=None)[0])


def simulate_open_loop(problem: Problem, model: Fit) -> Samples:
    """Measured minus simulated [N, m, m], shape (N,), with the model's friction and no shot's own."""
    state = initialise(problem.with_effects(model.effects), model.theta, PINNED_SPREAD)
    return problem.shots.unwhiten(state.residual)
