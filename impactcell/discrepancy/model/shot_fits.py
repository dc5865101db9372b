"""What belongs to one shot only, eliminated and refitted shot by shot: friction, speed, mass, onset."""

import math
from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np

from impactcell.discrepancy.data import IndexArray
from impactcell.discrepancy.model.problem import FitState, Problem, total_cost
from impactcell.discrepancy.model.shot_parameters import ShotParameters, known_std
from impactcell.records import Samples

THOROUGH_STEPS = 8
"""Gauss-Newton steps of the shots' own numbers where nothing is known of them yet."""
FEW_STEPS = 3
"""The same where they have been fitted before."""
SHORTER_STEPS = (1.0, 0.3, 0.1)
"""Shares of a step that are tried where every shot's own numbers are fitted thoroughly."""
SETTLED_GAIN = 1e-3
"""Fall of the cost [one squared standard deviation] below which they count as fitted."""
RIDGE = 1e-10
"""Relative ridge on a shot's normal equations: a number that the shot cannot see stays where it is."""
PINNED_SPREAD = 1e-7
"""A spread of the friction factors that leaves them no freedom."""


@dataclass(frozen=True, slots=True, eq=False)
class ShotNormalEquations:
    """Blocks of the normal equations that belong to single shots.

    Attributes
    ----------
    inverse : ndarray, shape (n, q, q)
    cross : ndarray, shape (n, q, p)
    gradient : ndarray, shape (n, q)
    """

    inverse: Samples
    cross: Samples
    gradient: Samples

    def steps(self, shared_step: Samples) -> Samples:
        """Step of each shot's own numbers that goes with a step of the shared ones, shape (n, q)."""
        right = self.gradient - self.cross @ shared_step
        steps: Samples = np.einsum("iqr,ir->iq", self.inverse, right)
        return steps


def initialise(
    problem: Problem,
    theta: Samples,
    spread: float,
    log_factors: tuple[float, ...] = (0.0,),
    steps: int = THOROUGH_STEPS,
) -> FitState:
    """Fit each shot's own numbers from several starts at fixed shared coordinates, and keep the best."""
    excitation = problem.shots.excitation
    best: FitState | None = None
    for share in excitation.guess_shares:
        guess = problem.initial_guess(share)
        for log_factor in log_factors:
            start = replace(guess, log_factor=guess.log_factor + log_factor)
            if excitation.state_comes_first:
                pinned = problem.evaluate(theta, start, PINNED_SPREAD)
                start = fit_shot_parameters(problem, pinned, steps).shot_parameters
            state = fit_shot_parameters(problem, problem.evaluate(theta, start, spread), steps)
            best = state if best is None else better_per_shot(problem, best, state)
    if best is None:
        raise AssertionError(excitation)
    return best


def fit_shot_parameters(problem: Problem, state: FitState, steps: int = FEW_STEPS) -> FitState:
    """Fit every shot's own numbers at fixed shared ones."""
    for _ in range(steps):
        if not state.cost < math.inf:
            return state
        shot_steps = shot_equations(problem, state).steps(np.empty(0))
        improved = state
        for scale in SHORTER_STEPS:
            # Shorter steps for the shots that the whole step did not help; the best so far is kept.
            moved = problem.freedom.step(state.shot_parameters, scale * shot_steps)
            trial = problem.evaluate(state.theta, moved, state.spread)
            improved = better_per_shot(problem, improved, trial)
            if steps < THOROUGH_STEPS:
                break
        if state.cost - improved.cost < SETTLED_GAIN:
            return improved
        state = improved
    return state


def shot_equations(problem: Problem, state: FitState) -> ShotNormalEquations:
    """Set up the normal equations of every shot's own numbers at fixed shared ones."""
    nothing_shared = np.empty((0, state.residual.size))
    return normal_equations(problem, nothing_shared, problem.shot_jacobian(state), state)[2]


def correct_shot_parameters(
    problem: Problem, trial: FitState, Jl: Samples, equations: ShotNormalEquations
) -> FitState:
    """One step of every shot's own numbers at the new shared ones; kept where it helps the shot."""
    if not trial.cost < math.inf:
        return trial
    gradient = np.add.reduceat(Jl * trial.residual, problem.shots.bounds[:-1], axis=1).T
    gradient -= _pull(problem, trial)
    steps = np.einsum("iqr,ir->iq", equations.inverse, gradient)
    moved = problem.freedom.step(trial.shot_parameters, steps)
    return better_per_shot(problem, trial, problem.evaluate(trial.theta, moved, trial.spread))


def better_per_shot(problem: Problem, current: FitState, trial: FitState) -> FitState:
    """Take each shot's own numbers from whichever of two states suits the shot better."""

    def cost_per_shot(state: FitState) -> Samples:
        misfit = np.add.reduceat(state.residual**2, problem.shots.bounds[:-1])
        cost = misfit + state.shot_parameters.cost(current.spread)
        return np.nan_to_num(cost, nan=math.inf)

    better = cost_per_shot(trial) < cost_per_shot(current)
    shot_parameters = ShotParameters(
        *(
            np.where(
                better, getattr(trial.shot_parameters, item.name), getattr(current.shot_parameters, item.name)
            )
            for item in fields(ShotParameters)
        )
    )
    residual = np.where(np.repeat(better, problem.sizes), trial.residual, current.residual)
    cost = total_cost(residual, shot_parameters, current.spread)
    return FitState(trial.theta, shot_parameters, current.spread, residual, cost)


def normal_equations(
    problem: Problem, J: Samples, Jl: Samples, state: FitState
) -> tuple[Samples, Samples, ShotNormalEquations]:
    """Set up the normal equations of the shared coordinates, each shot's own eliminated.

    Parameters
    ----------
    J, Jl : ndarray, shapes (p, N) and (q, N)
        Derivatives by shared coordinates and by shots' own numbers.
    state : FitState

    Returns
    -------
    H, g, equations
        Information, shape (p, p), and minus half the cost's gradient, shape (p,), of the shared coordinates
        (Schur complement), so that a step is H^-1 g; and the shots' own blocks, their gradients alike. What a
        shot has of its own stays where it presses against an end of its range: a step of the shared ones
        that counts on it to go on would find the shot no better.
    """
    q, p = len(Jl), len(J)
    gram = gram_of_shots(np.vstack([Jl, J, state.residual]), problem.shots.bounds)
    A, C, gl = gram[:, :q, :q].copy(), gram[:, :q, q : q + p], gram[:, :q, -1].copy()
    whole = gram[:, q:, q:].sum(0)
    H, g = whole[:p, :p], whole[:p, -1]
    A[:, np.arange(q), np.arange(q)] += _weights(problem, state.spread)
    gl -= _pull(problem, state)
    held = problem.freedom.pressed(state.shot_parameters, gl)
    gl[held], C[held] = 0.0, 0.0
    of_held = held[:, :, None] | held[:, None, :]
    A[of_held] = 0.0
    diagonal = np.einsum("iqq->iq", A)
    A[:, np.arange(q), np.arange(q)] += RIDGE * diagonal + (diagonal == 0.0)
    inverse = np.asarray(np.linalg.inv(A), dtype=np.float64)
    inverse[of_held] = 0.0
    eliminated = (inverse @ C).reshape(problem.count * q, p).T
    H = H - eliminated @ C.reshape(problem.count * q, p)
    g = g - eliminated @ gl.ravel()
    return H, g, ShotNormalEquations(inverse, C, gl)


def _weights(problem: Problem, spread: float) -> Samples:
    """One over the variance of what every shot has of its own, shape (q,); 0 where nothing is known of it."""
    std = known_std(spread)
    return np.array([1.0 / std[name] ** 2 if name in std else 0.0 for name in problem.shot_parameter_names])


def _pull(problem: Problem, state: FitState) -> Samples:
    """Half the gradient, shape (n, q), of what it costs the shots to be far from what is known of them."""
    std = known_std(state.spread)
    pull = np.zeros((problem.count, len(problem.shot_parameter_names)))
    for column, name in enumerate(problem.shot_parameter_names):
        if name in std:
            pull[:, column] = getattr(state.shot_parameters, name) / std[name] ** 2
    return pull


def gram_of_shots(rows: Samples, bounds: IndexArray) -> Samples:
    """Products of rows, shape (r, N), with each other, shot by shot, shape (n, r, r)."""
    parts = [rows[:, begin:end] for begin, end in pairwise(bounds.tolist())]
    return np.array([part @ part.T for part in parts])
