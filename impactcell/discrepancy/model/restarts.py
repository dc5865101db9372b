"""Fits that have come to rest short of their optimum, begun again from where no step would have led.

A few shots whose events come in another order hold up the fit of all; a coordinate has no slope at a bound.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.discrepancy.data import IndexArray
from impactcell.discrepancy.model.gauss_newton import gauss_newton
from impactcell.discrepancy.model.problem import FitState, Problem, total_cost
from impactcell.discrepancy.model.shot_fits import better_per_shot, initialise, shot_equations
from impactcell.records import Samples


@dataclass(frozen=True, slots=True)
class RestartPolicy:
    """When a fit is begun again; numbers found by trial.

    Attributes
    ----------
    restarts : int
        How often for stuck shots.
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
    rough_steps, rough_tolerance : int, float
        Steps and tolerance of that fit.
    """

    restarts: int = 2
    promise: float = 2.0
    worth_another: float = 1.0
    hopeless_misfit: float = 25.0
    far_misfit: float = 4.0
    fewest_share: float = 0.6
    rough_steps: int = 10
    rough_tolerance: float = 1.0


POLICY = RestartPolicy()
"""The policy in use."""


def begin_again(problem: Problem, state: FitState, most_steps: int, tolerance: float) -> FitState:
    """Begin a fit again wherever it is held up, and keep what is better."""
    for _ in range(POLICY.restarts):
        stuck = _stuck_shots(problem, state)
        if not len(stuck):
            break
        before = state.cost
        state = centre_factors(problem, _refit_without_stuck(problem, state, stuck))
        state = gauss_newton(problem, state, most_steps, tolerance)
        if state.cost > before - POLICY.worth_another:
            break
    return _leave_flat_bounds(problem, state, most_steps, tolerance)


def centre_factors(problem: Problem, state: FitState) -> FitState:
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
    refitted = gauss_newton(part, start, POLICY.rough_steps, POLICY.rough_tolerance)
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


def _leave_flat_bounds(problem: Problem, state: FitState, most_steps: int, tolerance: float) -> FitState:
    """Begin again inside the range of coordinates that have come to a bound at which they have no slope.

    mu_s/mu_k beside a compliant stiction is one: at 1 the prediction does not change with it to first order,
    so that no step leaves it, however much better it would be further on.
    """
    lower, upper = problem.bounds()
    at_bound = ((state.theta <= lower) | (state.theta >= upper)) & (lower < upper)
    if not at_bound.any() or not state.cost < POLICY.hopeless_misfit * state.residual.size:
        return state
    flat = np.zeros_like(at_bound)
    for column in np.flatnonzero(at_bound).tolist():
        change = float(np.linalg.norm(problem.shared_derivative(state, column)))
        flat[column] = change * (upper[column] - lower[column]) < 1.0
    if not flat.any():
        return state
    initial = np.array([coordinate.initial for coordinate in problem.coordinates])
    start = problem.evaluate(np.where(flat, initial, state.theta), state.shot_parameters, state.spread)
    again = gauss_newton(problem, start, most_steps, tolerance) if start.cost < math.inf else start
    return again if again.cost < state.cost else state


def _misfit_per_sample(problem: Problem, state: FitState) -> Samples:
    misfit: Samples = np.add.reduceat(state.residual**2, problem.shots.bounds[:-1]) / problem.sizes
    return misfit
