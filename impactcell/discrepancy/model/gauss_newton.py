"""Damped Gauss-Newton steps of the shared coordinates, every shot's own numbers eliminated."""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.discrepancy.model.problem import FitState, Problem, total_cost
from impactcell.discrepancy.model.shot_fits import correct_shot_parameters, normal_equations
from impactcell.records import Samples


@dataclass(frozen=True, slots=True)
class StepPolicy:
    """How steps are damped and when they end (Levenberg 1944, Marquardt 1963); numbers found by trial.

    Attributes
    ----------
    first_damping, smallest_damping, largest_damping : float
        Relative to the diagonal of the information; beyond the largest one a fit has come to rest.
    raise_damping, lower_damping : float
        Factors after a step that did not help, and after one that did.
    attempts : int
        Steps tried with one Jacobian.
    smallest_diagonal : float
        Scale, over the largest, of a coordinate that the data do not see.
    smallest_spread : float
        Of the logarithm of the friction factors: no friction repeats to better than 0.02 %.
    still : float
        Change of every coordinate below which derivatives are not taken anew.
    settled_spread : float
        Relative change of the spread below which it counts as settled.
    hopeless : float
        Share of the misfit above the floor that is not worth a step: a model that is far from the floor
        need not be found to the last digit.
    """

    first_damping: float = 1e-3
    smallest_damping: float = 1e-9
    largest_damping: float = 1e12
    raise_damping: float = 10.0
    lower_damping: float = 8.0
    attempts: int = 8
    smallest_diagonal: float = 1e-12
    smallest_spread: float = 2e-4
    still: float = 0.02
    settled_spread: float = 0.01
    hopeless: float = 3e-5


STEPS = StepPolicy()
"""The policy in use."""


def gauss_newton(problem: Problem, state: FitState, most_steps: int, tolerance: float) -> FitState:
    """Step until the cost no longer falls by `tolerance`; the factors' spread is fitted too."""
    bounds = problem.bounds()
    damping = STEPS.first_damping
    small_gains = 0
    keep_jacobian = False
    J = Jl = np.empty(0)
    for _ in range(most_steps):
        if not keep_jacobian:
            J, Jl = problem.linearise(state)
        H, g, equations = normal_equations(problem, J, Jl, state)
        H, g = H + problem.penalty_matrix, g - problem.penalty_matrix @ state.theta
        penalty = problem.penalty(state.theta)
        trial: FitState | None = None
        for _attempt in range(1 if keep_jacobian else STEPS.attempts):
            theta = _damped_step(state.theta, H, g, damping, bounds)
            moved = problem.freedom.step(state.shot_parameters, equations.steps(theta - state.theta))
            attempt = problem.evaluate(theta, moved, state.spread)
            attempt = correct_shot_parameters(problem, attempt, Jl, equations)
            if attempt.cost + problem.penalty(theta) < state.cost + penalty:
                trial = attempt
                break
            damping *= STEPS.raise_damping
            if damping > STEPS.largest_damping:
                break
        if trial is None:
            if not keep_jacobian:
                break
            damping /= STEPS.raise_damping
            keep_jacobian = False
            continue
        # Derivatives are worth having anew only when the parameters have moved since.
        keep_jacobian = float(np.abs(trial.theta - state.theta).max(initial=0.0)) < STEPS.still
        damping = max(damping / STEPS.lower_damping, STEPS.smallest_damping)
        fall = penalty - problem.penalty(trial.theta)
        gain, spread_before = state.cost - trial.cost + fall, state.spread
        state = _with_fitted_spread(trial)
        excess = max(state.cost - state.residual.size, 0.0)
        is_settled = abs(math.log(state.spread / spread_before)) < STEPS.settled_spread
        is_small = gain < max(tolerance, STEPS.hopeless * excess) and is_settled
        small_gains = small_gains + 1 if is_small else 0
        if small_gains > (gain >= tolerance):
            break
    return state


def _damped_step(
    theta: Samples, H: Samples, g: Samples, damping: float, bounds: tuple[Samples, Samples]
) -> Samples:
    """Coordinates after a damped step inside the bounds; those that press against one stay there."""
    lower, upper = bounds
    free = ~(((theta <= lower) & (g < 0.0)) | ((theta >= upper) & (g > 0.0)))
    scaled = H[np.ix_(free, free)].copy()
    least = STEPS.smallest_diagonal * max(float(np.diag(H).max()), 1e-300)
    scaled[np.diag_indices_from(scaled)] += damping * np.maximum(np.diag(scaled), least)
    step = np.zeros_like(theta)
    step[free] = np.linalg.lstsq(scaled, g[free], rcond=None)[0]
    return np.clip(theta + step, lower, upper)


def _with_fitted_spread(state: FitState) -> FitState:
    spread = max(float(np.sqrt(np.mean(state.shot_parameters.log_factor**2))), STEPS.smallest_spread)
    return replace(state, spread=spread, cost=total_cost(state.residual, state.shot_parameters, spread))
