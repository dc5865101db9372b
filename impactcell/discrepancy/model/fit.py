"""Least squares with every shot's own friction factor eliminated inside every step.

Minimised is |r|² + sum (log f_i / s)²: the whitened residuals of all traces, and the spread s of the friction
factors about one. Numbers that belong to one shot only (friction factor, initial speed, unknown mass) are
eliminated shot by shot, so that the system to solve is no larger than the shared parameters (variable
projection on a block-arrow matrix), and refitted after every trial step: without that fits stall.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.discrepancy.data.shots import IndexArray, ShotSet
from impactcell.discrepancy.model.forward import ShotParameters
from impactcell.discrepancy.model.parameters import Coordinate
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.model.shot_parameters import (
    THOROUGH_STEPS,
    FitState,
    better_per_shot,
    correct_shot_parameters,
    evaluate,
    fit_shot_parameters,
    initialise,
    normal_equations,
    shot_steps,
    total_cost,
)
from impactcell.errors import DiscrepancyError
from impactcell.records import Samples

FIRST_SPREAD = 0.03
SMALLEST_SPREAD = 2e-4
GIVES_UP = 1e12
HOPELESS = 3e-5
WHOLE = 10
PROMISE = 2.0
RESCUES = 2
FAR = 4.0
NOT_IT = 25.0
NEAR = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A fitted model.

    Attributes
    ----------
    effects : tuple of str
    coordinates : tuple of Coordinate
    theta : ndarray, shape (p,)
        Coordinates at the optimum.
    shot_parameters : Local
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


def fit(
    problem: Problem,
    effects: tuple[str, ...],
    theta: Samples,
    shot_parameters: ShotParameters,
    *,
    spread: float = FIRST_SPREAD,
    most_steps: int = 30,
    tolerance: float = 0.02,
) -> Fit:
    """Fit the shared coordinates and every shot's own numbers by damped Gauss-Newton steps.

    Parameters
    ----------
    problem : Problem
    effects : tuple of str
    theta : ndarray, shape (p,)
        Start, in coordinates.
    shot_parameters : Local
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
    coordinates = problem.coordinates(effects)
    lower = np.array([coordinate.lower for coordinate in coordinates])
    upper = np.array([coordinate.upper for coordinate in coordinates])
    theta = np.clip(theta, lower, upper)
    point = fit_shot_parameters(
        problem, effects, evaluate(problem, effects, theta, shot_parameters, spread), spread
    )
    if not point.cost < math.inf:
        raise DiscrepancyError(
            f"the plant with {', '.join(effects) or 'no effect'} has no answer at the start"
        )
    limits = (lower, upper)
    point = _centre_factors(coordinates, point, spread)
    point, spread = _gauss_newton(problem, effects, point, spread, limits, (most_steps, tolerance))
    if most_steps >= WHOLE:
        for _ in range(RESCUES):
            stuck = _stuck_shots(problem, effects, point, spread)
            if not len(stuck):
                break
            before = point.cost
            point = _centre_factors(
                coordinates, _refit_without_stuck(problem, effects, point, spread, limits, stuck), spread
            )
            point, spread = _gauss_newton(problem, effects, point, spread, limits, (most_steps, tolerance))
            if point.cost > before - 1.0:
                break
    return Fit(effects, coordinates, point.theta, point.shot_parameters, spread, point.residual)


def _centre_factors(coordinates: tuple[Coordinate, ...], point: FitState, spread: float) -> FitState:
    """Move what all friction factors have in common into mu_k, which leaves every trace as it is."""
    column = next(
        i
        for i, coordinate in enumerate(coordinates)
        if coordinate.parameter == "mu_k" and not coordinate.effect
    )
    common = float(np.median(point.shot_parameters.log_factor))
    moved = min(
        max(float(point.theta[column]) + common, coordinates[column].lower), coordinates[column].upper
    )
    common = moved - float(point.theta[column])
    theta = point.theta.copy()
    theta[column] = moved
    shot_parameters = replace(point.shot_parameters, log_factor=point.shot_parameters.log_factor - common)
    return FitState(
        theta, shot_parameters, point.residual, total_cost(point.residual, shot_parameters, spread)
    )


def _refit_without_stuck(
    problem: Problem,
    effects: tuple[str, ...],
    point: FitState,
    spread: float,
    limits: tuple[Samples, Samples],
    stuck: IndexArray,
) -> FitState:
    """Start the stuck shots again, at shared parameters to which only the other shots are fitted.

    A few shots whose events come in another order hold up the fit of all: every step that helps the others
    makes them worse. Shots that are far off are left out with them.
    """
    point = _reinitialise(problem, effects, point, spread, stuck)
    misfit = np.add.reduceat(point.residual**2, problem.shots.bounds[:-1]) / problem.sizes
    good = np.setdiff1d(np.flatnonzero(misfit <= FAR * float(np.median(misfit))), stuck)
    if len(good) == problem.count or len(good) < 0.6 * problem.count:
        return point
    part = Problem(problem.shots.select(good), problem.forward.batches)
    start = evaluate(part, effects, point.theta, point.shot_parameters.samples_of(good), spread)
    refitted, _ = _gauss_newton(part, effects, start, spread, limits, (WHOLE, 1.0))
    moved = evaluate(
        problem, effects, refitted.theta, point.shot_parameters.put(good, refitted.shot_parameters), spread
    )
    left_out = np.setdiff1d(np.arange(problem.count), good)
    restarted = _reinitialise(problem, effects, moved, spread, left_out)
    return restarted if restarted.cost < point.cost else point


def _reinitialise(
    problem: Problem, effects: tuple[str, ...], point: FitState, spread: float, which: IndexArray
) -> FitState:
    """Start some shots again; each keeps what suits it better."""
    part = Problem(problem.shots.select(which), problem.forward.batches)
    reinitialised = initialise(part, effects, point.theta, spread, (0.0, -spread, spread))
    restarted = evaluate(
        problem, effects, point.theta, point.shot_parameters.put(which, reinitialised.shot_parameters), spread
    )
    return better_per_shot(problem, point, restarted, spread)


def _stuck_shots(problem: Problem, effects: tuple[str, ...], point: FitState, spread: float) -> IndexArray:
    """Shots whose own numbers are not at their optimum: the cost would still fall to first order."""
    misfit = np.add.reduceat(point.residual**2, problem.shots.bounds[:-1]) / problem.sizes
    if float(np.median(misfit)) > NOT_IT:
        return np.empty(0, dtype=np.int64)
    Jl = problem.shot_jacobian(effects, point.theta, point.shot_parameters, point.residual)
    _, _, blocks = normal_equations(problem, np.empty((0, point.residual.size)), Jl, point, spread)
    promise = np.einsum("iq,iqr,ir->i", blocks.gradient, blocks.inverse, blocks.gradient)
    return np.flatnonzero(promise > PROMISE)


def _gauss_newton(
    problem: Problem,
    effects: tuple[str, ...],
    point: FitState,
    spread: float,
    limits: tuple[Samples, Samples],
    budget: tuple[int, float],
) -> tuple[FitState, float]:
    """Damped Gauss-Newton steps until the cost no longer falls."""
    lower, upper = limits
    most_steps, tolerance = budget
    damping = 1e-3
    small_gains = 0
    keep_jacobian = False
    J = Jl = np.empty(0)
    for _ in range(most_steps):
        if not keep_jacobian:
            J = problem.shared_jacobian(effects, point.theta, point.shot_parameters, point.residual)
            Jl = problem.shot_jacobian(effects, point.theta, point.shot_parameters, point.residual)
        H, g, blocks = normal_equations(problem, J, Jl, point, spread)
        improved = False
        for _attempt in range(1 if keep_jacobian else 8):
            free = ~(((point.theta <= lower) & (g < 0.0)) | ((point.theta >= upper) & (g > 0.0)))
            step = np.zeros_like(point.theta)
            scaled = H[np.ix_(free, free)].copy()
            scale = np.maximum(np.diag(scaled), 1e-12 * max(float(np.diag(H).max()), 1e-300))
            scaled[np.diag_indices_from(scaled)] += damping * scale
            step[free] = np.linalg.lstsq(scaled, g[free], rcond=None)[0]
            trial_theta = np.clip(point.theta + step, lower, upper)
            own_steps = shot_steps(blocks, trial_theta - point.theta)
            trial = evaluate(
                problem,
                effects,
                trial_theta,
                problem.step_shot_parameters(point.shot_parameters, own_steps),
                spread,
            )
            trial = correct_shot_parameters(problem, effects, trial, Jl, blocks, spread)
            if trial.cost < point.cost:
                improved = True
                break
            damping *= 10.0
            if damping > GIVES_UP:
                break
        if not improved and keep_jacobian:
            damping /= 10.0
            keep_jacobian = False
            continue
        if not improved:
            break
        # Derivatives are worth having anew only when the parameters have moved since.
        keep_jacobian = float(np.abs(trial.theta - point.theta).max(initial=0.0)) < NEAR
        gain = point.cost - trial.cost
        point = trial
        damping = max(damping / 8.0, 1e-9)
        new_spread = max(float(np.sqrt(np.mean(point.shot_parameters.log_factor**2))), SMALLEST_SPREAD)
        moved = abs(math.log(new_spread / spread))
        spread = new_spread
        point = replace(point, cost=total_cost(point.residual, point.shot_parameters, spread))
        # A model that is far from the floor need not be found to the last digit.
        excess = max(point.cost - point.residual.size, 0.0)
        small_gains = small_gains + 1 if gain < max(tolerance, HOPELESS * excess) and moved < 0.01 else 0
        if small_gains > (gain >= tolerance):
            break
    return point, spread


def refit_shot_parameters(problem: Problem, model: Fit) -> Fit:
    """Keep the shared parameters of `model` and fit only what every shot of `problem` has of its own."""
    point = initialise(problem, model.effects, model.theta, 1e3, (0.0, -model.spread, model.spread))
    return replace(model, shot_parameters=point.shot_parameters, residual=point.residual)


def initial_shot_parameters(
    problem: Problem, effects: tuple[str, ...], theta: Samples, steps: int = THOROUGH_STEPS
) -> ShotParameters:
    """Fit what every shot has of its own from several starts; the best of them shot by shot."""
    return initialise(problem, effects, theta, FIRST_SPREAD, steps=steps).shot_parameters
