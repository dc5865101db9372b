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

from impactcell.discrepancy.data import IndexArray, ShotSet
from impactcell.discrepancy.model.gauss_newton import gauss_newton
from impactcell.discrepancy.model.parameters import Coordinate
from impactcell.discrepancy.model.problem import FitState, Problem, total_cost
from impactcell.discrepancy.model.shot_fits import (
    PINNED_SPREAD,
    better_per_shot,
    fit_shot_parameters,
    initialise,
    normal_equations,
    shot_equations,
)
from impactcell.discrepancy.model.shot_parameters import ShotParameters
from impactcell.errors import DiscrepancyError
from impactcell.records import Samples


@dataclass(frozen=True, slots=True)
class FitPolicy:
    """When a fit begins, ends, and starts shots again that hold it up; numbers found by trial.

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
        Only a fit that may run this far starts stuck shots again.
    restarts : int
        How often.
    promise : float
        Fall of the cost to first order at which a shot's own numbers are not at their optimum.
    worth_another : float
        Fall of the cost by one restart without which there is no second one.
    hopeless_misfit : float
        Median mean squared residual beyond which the model is wrong, not a shot stuck.
    far_misfit : float
        Times the median: shots beyond it are left out while the others are refitted.
    fewest_share : float
        Share of the shots that must remain for that.
    rough_tolerance : float
        Tolerance of that fit.
    """

    first_spread: float = 0.03
    wide_spread: float = 1e3
    most_steps: int = 30
    tolerance: float = 0.02
    fewest_steps_to_restart: int = 10
    restarts: int = 2
    promise: float = 2.0
    worth_another: float = 1.0
    hopeless_misfit: float = 25.0
    far_misfit: float = 4.0
    fewest_share: float = 0.6
    rough_tolerance: float = 1.0


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
    state = gauss_newton(problem, _centre_factors(problem, state), most_steps, tolerance)
    if most_steps >= POLICY.fewest_steps_to_restart:
        for _ in range(POLICY.restarts):
            stuck = _stuck_shots(problem, state)
            if not len(stuck):
                break
            before = state.cost
            state = _centre_factors(problem, _refit_without_stuck(problem, state, stuck))
            state = gauss_newton(problem, state, most_steps, tolerance)
            if state.cost > before - POLICY.worth_another:
                break
        state = _leave_flat_bounds(problem, state, most_steps, tolerance)
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


def _leave_flat_bounds(problem: Problem, state: FitState, most_steps: int, tolerance: float) -> FitState:
    """Begin again inside the range of coordinates that have come to a bound at which they have no slope.

    mu_s/mu_k beside a compliant stiction is one: at 1 the prediction does not change with it to first order,
    so that no step leaves it, however much better it would be further on.
    """
    lower, upper = problem.bounds()
    at_bound = ((state.theta <= lower) | (state.theta >= upper)) & (lower < upper)
    if not at_bound.any() or not state.cost < POLICY.hopeless_misfit * state.residual.size:
        return state
    change = np.linalg.norm(problem.shared_jacobian(state), axis=1) * (upper - lower)
    flat = at_bound & (change < 1.0)
    if not flat.any():
        return state
    initial = np.array([coordinate.initial for coordinate in problem.coordinates])
    start = problem.evaluate(np.where(flat, initial, state.theta), state.shot_parameters, state.spread)
    again = gauss_newton(problem, start, most_steps, tolerance) if start.cost < math.inf else start
    return again if again.cost < state.cost else state


def _centre_factors(problem: Problem, state: FitState) -> FitState:
    """Move what all friction factors have in common into mu_k, which leaves every trace as it is."""
    column = next(
        column
        for column, coordinate in enumerate(problem.coordinates)
        if coordinate.parameter == "mu_k" and not coordinate.effect
    )
    coordinate = problem.coordinates[column]
    common = float(np.median(state.shot_parameters.log_factor))
    moved = min(max(float(state.theta[column]) + common, coordinate.lower), coordinate.upper)
    common = moved - float(state.theta[column])
    theta = state.theta.copy()
    theta[column] = moved
    shot_parameters = replace(state.shot_parameters, log_factor=state.shot_parameters.log_factor - common)
    cost = total_cost(state.residual, shot_parameters, state.spread)
    return FitState(theta, shot_parameters, state.spread, state.residual, cost)


def _refit_without_stuck(problem: Problem, state: FitState, stuck: IndexArray) -> FitState:
    """Start the stuck shots again, at shared parameters to which only the other shots are fitted.

    A few shots whose events come in another order hold up the fit of all: every step that helps the others
    makes them worse. Shots that are far off are left out with them.
    """
    state = _reinitialise(problem, state, stuck)
    misfit = _misfit_per_sample(problem, state)
    good = np.setdiff1d(np.flatnonzero(misfit <= POLICY.far_misfit * float(np.median(misfit))), stuck)
    if len(good) == problem.count or len(good) < POLICY.fewest_share * problem.count:
        return state
    part = problem.select(good)
    start = part.evaluate(state.theta, state.shot_parameters.select(good), state.spread)
    refitted = gauss_newton(part, start, POLICY.fewest_steps_to_restart, POLICY.rough_tolerance)
    shot_parameters = state.shot_parameters.with_shots(good, refitted.shot_parameters)
    moved = problem.evaluate(refitted.theta, shot_parameters, state.spread)
    left_out = np.setdiff1d(np.arange(problem.count), good)
    restarted = _reinitialise(problem, moved, left_out)
    return restarted if restarted.cost < state.cost else state


def _reinitialise(problem: Problem, state: FitState, indices: IndexArray) -> FitState:
    """Start some shots again; each keeps what suits it better."""
    factors = (0.0, -state.spread, state.spread)
    again = initialise(problem.select(indices), state.theta, state.spread, factors)
    shot_parameters = state.shot_parameters.with_shots(indices, again.shot_parameters)
    return better_per_shot(problem, state, problem.evaluate(state.theta, shot_parameters, state.spread))


def _stuck_shots(problem: Problem, state: FitState) -> IndexArray:
    """Shots whose own numbers are not at their optimum: the cost would still fall to first order."""
    if float(np.median(_misfit_per_sample(problem, state))) > POLICY.hopeless_misfit:
        return np.empty(0, dtype=np.int64)
    equations = shot_equations(problem, state)
    promise = np.einsum("iq,iqr,ir->i", equations.gradient, equations.inverse, equations.gradient)
    return np.flatnonzero(promise > POLICY.promise)


def _misfit_per_sample(problem: Problem, state: FitState) -> Samples:
    misfit: Samples = np.add.reduceat(state.residual**2, problem.shots.bounds[:-1]) / problem.sizes
    return misfit


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
