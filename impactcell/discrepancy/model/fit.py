"""Least squares with every shot's own friction factor eliminated inside every step.

Minimised is |r|² + sum (log f_i / s)²: the whitened residuals of all traces, and the spread s of the friction
factors about one. Numbers that belong to one shot only (friction factor, initial speed, unknown mass) are
eliminated shot by shot, so that the system to solve is no larger than the shared parameters (variable
projection on a block-arrow matrix), and refitted after every trial step: without that fits stall.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.discrepancy.data.shots import Index, Shots
from impactcell.discrepancy.model.forward import Local
from impactcell.discrepancy.model.parameters import Coordinate
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.model.shot_parameters import (
    THOROUGH,
    Point,
    begin_at,
    better_of,
    correct,
    cost_of,
    normal,
    own_steps,
    point_at,
    settle,
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
    at : ndarray, shape (p,)
        Coordinates at the optimum.
    local : Local
    spread : float
        Standard deviation of the logarithm of the friction factors.
    residual : ndarray, shape (N,)
        Measured minus predicted, over the sensors' noise.
    """

    effects: tuple[str, ...]
    coordinates: tuple[Coordinate, ...]
    at: Samples
    local: Local
    spread: float
    residual: Samples

    def misfit(self, shots: Shots) -> Samples:
        """Squared residual of every shot, shape (n,)."""
        return np.add.reduceat(self.residual**2, shots.bounds[:-1])

    def log_likelihood(self, shots: Shots) -> Samples:
        """Log-likelihood of every shot but for constants, shape (n,): its traces, and its factor."""
        factor = (self.local.log_factor / self.spread) ** 2 + 2.0 * math.log(self.spread)
        return -0.5 * (self.misfit(shots) + factor)


def fit(
    problem: Problem,
    effects: tuple[str, ...],
    at: Samples,
    local: Local,
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
    at : ndarray, shape (p,)
        Start, in coordinates.
    local : Local
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
    lower = np.array([one.lower for one in coordinates])
    upper = np.array([one.upper for one in coordinates])
    at = np.clip(at, lower, upper)
    point = settle(problem, effects, point_at(problem, effects, at, local, spread), spread)
    if not point.cost < math.inf:
        raise DiscrepancyError(
            f"the plant with {', '.join(effects) or 'no effect'} has no answer at the start"
        )
    limits = (lower, upper)
    point = _recentred(coordinates, point, spread)
    point, spread = _descend(problem, effects, point, spread, limits, (most_steps, tolerance))
    if most_steps >= WHOLE:
        for _ in range(RESCUES):
            stuck = _stuck(problem, effects, point, spread)
            if not len(stuck):
                break
            before = point.cost
            point = _recentred(coordinates, _rescued(problem, effects, point, spread, limits, stuck), spread)
            point, spread = _descend(problem, effects, point, spread, limits, (most_steps, tolerance))
            if point.cost > before - 1.0:
                break
    return Fit(effects, coordinates, point.at, point.local, spread, point.residual)


def _recentred(coordinates: tuple[Coordinate, ...], point: Point, spread: float) -> Point:
    """Move what all friction factors have in common into mu_k, which leaves every trace as it is."""
    place = next(i for i, one in enumerate(coordinates) if one.parameter == "mu_k" and not one.effect)
    common = float(np.median(point.local.log_factor))
    moved = min(max(float(point.at[place]) + common, coordinates[place].lower), coordinates[place].upper)
    common = moved - float(point.at[place])
    at = point.at.copy()
    at[place] = moved
    local = replace(point.local, log_factor=point.local.log_factor - common)
    return Point(at, local, point.residual, cost_of(point.residual, local, spread))


def _rescued(
    problem: Problem,
    effects: tuple[str, ...],
    point: Point,
    spread: float,
    limits: tuple[Samples, Samples],
    stuck: Index,
) -> Point:
    """Start the stuck shots again, at shared parameters to which only the other shots are fitted.

    A few shots whose events come in another order hold up the fit of all: every step that helps the others
    makes them worse. Shots that are far off are left out with them.
    """
    point = _begun_again(problem, effects, point, spread, stuck)
    misfit = np.add.reduceat(point.residual**2, problem.shots.bounds[:-1]) / problem.sizes
    good = np.setdiff1d(np.flatnonzero(misfit <= FAR * float(np.median(misfit))), stuck)
    if len(good) == problem.count or len(good) < 0.6 * problem.count:
        return point
    part = Problem(problem.shots.chosen(good), problem.forward.batches)
    start = point_at(part, effects, point.at, point.local.of(good), spread)
    found, _ = _descend(part, effects, start, spread, limits, (WHOLE, 1.0))
    moved = point_at(problem, effects, found.at, point.local.put(good, found.local), spread)
    others = np.setdiff1d(np.arange(problem.count), good)
    other = _begun_again(problem, effects, moved, spread, others)
    return other if other.cost < point.cost else point


def _begun_again(
    problem: Problem, effects: tuple[str, ...], point: Point, spread: float, which: Index
) -> Point:
    """Start some shots again; each keeps what suits it better."""
    part = Problem(problem.shots.chosen(which), problem.forward.batches)
    again = begin_at(part, effects, point.at, spread, (0.0, -spread, spread))
    new = point_at(problem, effects, point.at, point.local.put(which, again.local), spread)
    return better_of(problem, point, new, spread)


def _stuck(problem: Problem, effects: tuple[str, ...], point: Point, spread: float) -> Index:
    """Shots whose own numbers are not at their optimum: the cost would still fall to first order."""
    misfit = np.add.reduceat(point.residual**2, problem.shots.bounds[:-1]) / problem.sizes
    if float(np.median(misfit)) > NOT_IT:
        return np.empty(0, dtype=np.int64)
    Jl = problem.own_derivatives(effects, point.at, point.local, point.residual)
    _, _, blocks = normal(problem, np.empty((0, point.residual.size)), Jl, point, spread)
    promise = np.einsum("iq,iqr,ir->i", blocks.gradient, blocks.inverse, blocks.gradient)
    return np.flatnonzero(promise > PROMISE)


def _descend(
    problem: Problem,
    effects: tuple[str, ...],
    point: Point,
    spread: float,
    limits: tuple[Samples, Samples],
    budget: tuple[int, float],
) -> tuple[Point, float]:
    """Damped Gauss-Newton steps until the cost no longer falls."""
    lower, upper = limits
    most_steps, tolerance = budget
    damping = 1e-3
    calm = 0
    near = False
    J = Jl = np.empty(0)
    for _ in range(most_steps):
        if not near:
            J = problem.shared_derivatives(effects, point.at, point.local, point.residual)
            Jl = problem.own_derivatives(effects, point.at, point.local, point.residual)
        H, g, blocks = normal(problem, J, Jl, point, spread)
        taken = False
        for _attempt in range(1 if near else 8):
            free = ~(((point.at <= lower) & (g < 0.0)) | ((point.at >= upper) & (g > 0.0)))
            step = np.zeros_like(point.at)
            scaled = H[np.ix_(free, free)].copy()
            scale = np.maximum(np.diag(scaled), 1e-12 * max(float(np.diag(H).max()), 1e-300))
            scaled[np.diag_indices_from(scaled)] += damping * scale
            step[free] = np.linalg.lstsq(scaled, g[free], rcond=None)[0]
            there = np.clip(point.at + step, lower, upper)
            own = own_steps(blocks, there - point.at)
            trial = point_at(problem, effects, there, problem.moved(point.local, own), spread)
            trial = correct(problem, effects, trial, Jl, blocks, spread)
            if trial.cost < point.cost:
                taken = True
                break
            damping *= 10.0
            if damping > GIVES_UP:
                break
        if not taken and near:
            damping /= 10.0
            near = False
            continue
        if not taken:
            break
        # Derivatives are worth having anew only when the parameters have moved since.
        near = float(np.abs(trial.at - point.at).max(initial=0.0)) < NEAR
        gain = point.cost - trial.cost
        point = trial
        damping = max(damping / 8.0, 1e-9)
        newest = max(float(np.sqrt(np.mean(point.local.log_factor**2))), SMALLEST_SPREAD)
        moved = abs(math.log(newest / spread))
        spread = newest
        point = replace(point, cost=cost_of(point.residual, point.local, spread))
        # A model that is far from the floor need not be found to the last digit.
        excess = max(point.cost - point.residual.size, 0.0)
        calm = calm + 1 if gain < max(tolerance, HOPELESS * excess) and moved < 0.01 else 0
        if calm > (gain >= tolerance):
            break
    return point, spread


def refit_own(problem: Problem, model: Fit) -> Fit:
    """Keep the shared parameters of `model` and fit only what every shot of `problem` has of its own."""
    point = begin_at(problem, model.effects, model.at, 1e3, (0.0, -model.spread, model.spread))
    return replace(model, local=point.local, residual=point.residual)


def begin(problem: Problem, effects: tuple[str, ...], at: Samples, steps: int = THOROUGH) -> Local:
    """Fit what every shot has of its own from several starts; the best of them shot by shot."""
    return begin_at(problem, effects, at, FIRST_SPREAD, steps=steps).local
