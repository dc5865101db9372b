"""What belongs to one shot only, eliminated and refitted shot by shot: friction, initial speed, mass."""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.model.forward import ShotParameters
from impactcell.discrepancy.model.problem import Problem
from impactcell.records import Samples

THOROUGH_STEPS = 8
PINNED_SPREAD = 1e-7
"""A spread of the friction factors that leaves them no freedom."""


@dataclass(frozen=True, slots=True, eq=False)
class FitState:
    """Where a fit stands: shared coordinates, each shot's own numbers, whitened residuals and cost."""

    theta: Samples
    shot_parameters: ShotParameters
    residual: Samples
    cost: float


@dataclass(frozen=True, slots=True, eq=False)
class ShotNormalEquations:
    """Blocks of the normal equations that belong to single shots."""

    inverse: Samples  # (n, q, q)
    cross: Samples  # (n, q, p)
    gradient: Samples  # (n, q)


def initialise(
    problem: Problem,
    effects: tuple[str, ...],
    theta: Samples,
    spread: float,
    factors: tuple[float, ...] = (0.0,),
    steps: int = THOROUGH_STEPS,
) -> FitState:
    """Fit each shot's own numbers from several starts at fixed shared coordinates, and keep the best."""
    shares = {
        Excitation.TAP: (1.0,),
        Excitation.FREE_SLIDE: (1.0, 0.3),
        Excitation.DRIVEN: (0.0, 0.05),
    }
    best: FitState | None = None
    for share in shares[problem.shots.excitation]:
        first = problem.initial_shot_parameters(share)
        for factor in factors:
            start = replace(first, log_factor=first.log_factor + factor)
            if problem.shots.excitation is Excitation.DRIVEN:
                # A wrong speed makes other events than the right one: it comes first, alone.
                pinned = evaluate(problem, effects, theta, start, PINNED_SPREAD)
                start = fit_shot_parameters(problem, effects, pinned, PINNED_SPREAD, steps).shot_parameters
            point = fit_shot_parameters(
                problem, effects, evaluate(problem, effects, theta, start, spread), spread, steps
            )
            best = point if best is None else better_per_shot(problem, best, point, spread)
    if best is None:
        raise AssertionError(problem.shots.excitation)
    return best


def fit_shot_parameters(
    problem: Problem, effects: tuple[str, ...], point: FitState, spread: float, steps: int = 3
) -> FitState:
    """Fit every shot's own numbers at fixed shared ones."""
    for _ in range(steps):
        if not point.cost < math.inf:
            return point
        Jl = problem.shot_jacobian(effects, point.theta, point.shot_parameters, point.residual)
        none = np.empty((0, point.residual.size))
        _, _, blocks = normal_equations(problem, none, Jl, point, spread)
        steps_of = shot_steps(blocks, np.empty(0))
        improved = point
        for scale in (1.0, 0.3, 0.1):
            # Shorter steps for the shots that the whole step did not help; the best so far is kept.
            moved = problem.step_shot_parameters(point.shot_parameters, scale * steps_of)
            improved = better_per_shot(
                problem, improved, evaluate(problem, effects, point.theta, moved, spread), spread
            )
            if steps < THOROUGH_STEPS:
                break
        if point.cost - improved.cost < 1e-3:
            return improved
        point = improved
    return point


def correct_shot_parameters(
    problem: Problem,
    effects: tuple[str, ...],
    trial: FitState,
    Jl: Samples,
    blocks: ShotNormalEquations,
    spread: float,
) -> FitState:
    """One step of every shot's own numbers at the new shared ones; kept where it helps the shot."""
    if not trial.cost < math.inf:
        return trial
    gradient = np.add.reduceat(Jl * trial.residual, problem.shots.bounds[:-1], axis=1).T
    gradient[:, 0] -= trial.shot_parameters.log_factor / spread**2
    moved = problem.step_shot_parameters(
        trial.shot_parameters, np.einsum("iqr,ir->iq", blocks.inverse, gradient)
    )
    return better_per_shot(problem, trial, evaluate(problem, effects, trial.theta, moved, spread), spread)


def better_per_shot(problem: Problem, current: FitState, trial: FitState, spread: float) -> FitState:
    """Take each shot's own numbers from whichever of two points suits the shot better."""

    def cost_per_shot(point: FitState) -> Samples:
        sums = np.add.reduceat(point.residual**2, problem.shots.bounds[:-1])
        return np.nan_to_num(sums + (point.shot_parameters.log_factor / spread) ** 2, nan=math.inf)

    better = cost_per_shot(trial) < cost_per_shot(current)
    sample = np.repeat(better, problem.sizes)
    shot_parameters = ShotParameters(
        *(
            np.where(better, getattr(trial.shot_parameters, name), getattr(current.shot_parameters, name))
            for name in ("log_factor", "mass_kg", "speed_m_s", "shift_m")
        )
    )
    residual = np.where(sample, trial.residual, current.residual)
    return FitState(trial.theta, shot_parameters, residual, total_cost(residual, shot_parameters, spread))


def normal_equations(
    problem: Problem, J: Samples, Jl: Samples, point: FitState, spread: float
) -> tuple[Samples, Samples, ShotNormalEquations]:
    """Set up the normal equations of the shared coordinates, each shot's own eliminated."""
    q, p = len(Jl), len(J)
    rows = np.vstack([Jl, J, point.residual])
    gram = np.array(
        [rows[:, part] @ rows[:, part].T for part in map(problem.shots.samples_of, range(problem.count))]
    )
    A, C, gl = gram[:, :q, :q].copy(), gram[:, :q, q : q + p], gram[:, :q, -1].copy()
    whole = gram[:, q:, q:].sum(0)
    H, g = whole[:p, :p], whole[:p, -1]
    A[:, 0, 0] += 1.0 / spread**2
    gl[:, 0] -= point.shot_parameters.log_factor / spread**2
    diagonal = np.einsum("iqq->iq", A)
    A[:, np.arange(q), np.arange(q)] += 1e-10 * diagonal + (diagonal == 0.0)
    inverse = np.asarray(np.linalg.inv(A), dtype=np.float64)
    H = H - np.einsum("iqa,iqr,irb->ab", C, inverse, C, optimize=True)
    g = g - np.einsum("iqa,iqr,ir->a", C, inverse, gl, optimize=True)
    return H, g, ShotNormalEquations(inverse, C, gl)


def shot_steps(blocks: ShotNormalEquations, step: Samples) -> Samples:
    """Step of each shot's own numbers that goes with a step of the shared ones, shape (n, q)."""
    steps: Samples = np.einsum("iqr,ir->iq", blocks.inverse, blocks.gradient - blocks.cross @ step)
    return steps


def evaluate(
    problem: Problem, effects: tuple[str, ...], theta: Samples, shot_parameters: ShotParameters, spread: float
) -> FitState:
    """Evaluate a point."""
    residual = problem.residual(effects, theta, shot_parameters)
    return FitState(theta, shot_parameters, residual, total_cost(residual, shot_parameters, spread))


def total_cost(residual: Samples, shot_parameters: ShotParameters, spread: float) -> float:
    """Sum the squared misfit and the squared factors over their spread; infinite without an answer."""
    cost = float(np.einsum("i,i->", residual, residual)) + float(
        np.sum((shot_parameters.log_factor / spread) ** 2)
    )
    return cost if math.isfinite(cost) else math.inf
