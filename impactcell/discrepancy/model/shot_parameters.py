"""What belongs to one shot only, eliminated and refitted shot by shot: friction, initial speed, mass."""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.model.forward import Local
from impactcell.discrepancy.model.problem import Problem
from impactcell.records import Samples

THOROUGH = 8
PINNED = 1e-7
"""A spread of the friction factors that leaves them no freedom."""


@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """Where a fit stands: shared coordinates, each shot's own numbers, whitened residuals and cost."""

    at: Samples
    local: Local
    residual: Samples
    cost: float


@dataclass(frozen=True, slots=True, eq=False)
class Blocks:
    """Blocks of the normal equations that belong to single shots."""

    inverse: Samples  # (n, q, q)
    cross: Samples  # (n, q, p)
    gradient: Samples  # (n, q)


def begin_at(
    problem: Problem,
    effects: tuple[str, ...],
    at: Samples,
    spread: float,
    factors: tuple[float, ...] = (0.0,),
    steps: int = THOROUGH,
) -> Point:
    """Fit each shot's own numbers from several starts at fixed shared coordinates, and keep the best."""
    shares = {
        Excitation.TAP: (1.0,),
        Excitation.FREE_SLIDE: (1.0, 0.3),
        Excitation.DRIVEN: (0.0, 0.05),
    }
    best: Point | None = None
    for share in shares[problem.shots.excitation]:
        first = problem.first_local(share)
        for factor in factors:
            start = replace(first, log_factor=first.log_factor + factor)
            if problem.shots.excitation is Excitation.DRIVEN:
                # A wrong speed makes other events than the right one: it comes first, alone.
                pinned = point_at(problem, effects, at, start, PINNED)
                start = settle(problem, effects, pinned, PINNED, steps).local
            point = settle(problem, effects, point_at(problem, effects, at, start, spread), spread, steps)
            best = point if best is None else better_of(problem, best, point, spread)
    if best is None:
        raise AssertionError(problem.shots.excitation)
    return best


def settle(problem: Problem, effects: tuple[str, ...], point: Point, spread: float, steps: int = 3) -> Point:
    """Fit every shot's own numbers at fixed shared ones."""
    for _ in range(steps):
        if not point.cost < math.inf:
            return point
        Jl = problem.own_derivatives(effects, point.at, point.local, point.residual)
        none = np.empty((0, point.residual.size))
        _, _, blocks = normal(problem, none, Jl, point, spread)
        steps_of = own_steps(blocks, np.empty(0))
        new = point
        for scale in (1.0, 0.3, 0.1):
            # Shorter steps for the shots that the whole step did not help; the best so far is kept.
            moved = problem.moved(point.local, scale * steps_of)
            new = better_of(problem, new, point_at(problem, effects, point.at, moved, spread), spread)
            if steps < THOROUGH:
                break
        if point.cost - new.cost < 1e-3:
            return new
        point = new
    return point


def correct(
    problem: Problem, effects: tuple[str, ...], trial: Point, Jl: Samples, blocks: Blocks, spread: float
) -> Point:
    """One step of every shot's own numbers at the new shared ones; kept where it helps the shot."""
    if not trial.cost < math.inf:
        return trial
    gradient = np.add.reduceat(Jl * trial.residual, problem.shots.bounds[:-1], axis=1).T
    gradient[:, 0] -= trial.local.log_factor / spread**2
    moved = problem.moved(trial.local, np.einsum("iqr,ir->iq", blocks.inverse, gradient))
    return better_of(problem, trial, point_at(problem, effects, trial.at, moved, spread), spread)


def better_of(problem: Problem, old: Point, new: Point, spread: float) -> Point:
    """Take each shot's own numbers from whichever of two points suits the shot better."""

    def each(point: Point) -> Samples:
        sums = np.add.reduceat(point.residual**2, problem.shots.bounds[:-1])
        return np.nan_to_num(sums + (point.local.log_factor / spread) ** 2, nan=math.inf)

    better = each(new) < each(old)
    sample = np.repeat(better, problem.sizes)
    local = Local(
        *(
            np.where(better, getattr(new.local, name), getattr(old.local, name))
            for name in ("log_factor", "mass_kg", "speed_m_s", "shift_m")
        )
    )
    residual = np.where(sample, new.residual, old.residual)
    return Point(new.at, local, residual, cost_of(residual, local, spread))


def normal(
    problem: Problem, J: Samples, Jl: Samples, point: Point, spread: float
) -> tuple[Samples, Samples, Blocks]:
    """Set up the normal equations of the shared coordinates, each shot's own eliminated."""
    q, p = len(Jl), len(J)
    rows = np.vstack([Jl, J, point.residual])
    gram = np.array([rows[:, part] @ rows[:, part].T for part in map(problem.shots.of, range(problem.count))])
    A, C, gl = gram[:, :q, :q].copy(), gram[:, :q, q : q + p], gram[:, :q, -1].copy()
    whole = gram[:, q:, q:].sum(0)
    H, g = whole[:p, :p], whole[:p, -1]
    A[:, 0, 0] += 1.0 / spread**2
    gl[:, 0] -= point.local.log_factor / spread**2
    diagonal = np.einsum("iqq->iq", A)
    A[:, np.arange(q), np.arange(q)] += 1e-10 * diagonal + (diagonal == 0.0)
    inverse = np.asarray(np.linalg.inv(A), dtype=np.float64)
    H = H - np.einsum("iqa,iqr,irb->ab", C, inverse, C, optimize=True)
    g = g - np.einsum("iqa,iqr,ir->a", C, inverse, gl, optimize=True)
    return H, g, Blocks(inverse, C, gl)


def own_steps(blocks: Blocks, step: Samples) -> Samples:
    """Step of each shot's own numbers that goes with a step of the shared ones, shape (n, q)."""
    steps: Samples = np.einsum("iqr,ir->iq", blocks.inverse, blocks.gradient - blocks.cross @ step)
    return steps


def point_at(problem: Problem, effects: tuple[str, ...], at: Samples, local: Local, spread: float) -> Point:
    """Evaluate a point."""
    residual = problem.residual(effects, at, local)
    return Point(at, local, residual, cost_of(residual, local, spread))


def cost_of(residual: Samples, local: Local, spread: float) -> float:
    """Sum the squared misfit and the squared factors over their spread; infinite without an answer."""
    cost = float(np.einsum("i,i->", residual, residual)) + float(np.sum((local.log_factor / spread) ** 2))
    return cost if math.isfinite(cost) else math.inf
