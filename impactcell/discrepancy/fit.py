"""Least squares with every shot's own friction factor eliminated inside every step.

Minimised is |r|² + sum (log f_i / s)²: the whitened residuals of all traces, and the spread s of the friction
factors about one. Numbers that belong to one shot only (friction factor, initial speed, unknown mass) are
eliminated shot by shot, so that the system to solve is no larger than the shared parameters (variable
projection on a block-arrow matrix), and refitted after every trial step: without that fits stall.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.forward import Forward, Local
from impactcell.discrepancy.parameters import Coordinate, defaults, nominal, of_effect, vector
from impactcell.discrepancy.shots import Shots
from impactcell.errors import DiscrepancyError
from impactcell.records import Samples

STEP = 2e-5
FIRST_SPREAD = 0.03
SMALLEST_SPREAD = 2e-4
GIVES_UP = 1e12
HOPELESS = 3e-5
THOROUGH = 8
WHOLE = 10
PROMISE = 2.0
RESCUES = 2
FAR = 4.0
NOT_IT = 25.0


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


class Problem:
    """One set of shots to be fitted; holds no state but the shots.

    Parameters
    ----------
    shots : Shots
    batches : int
        How many batches the whole campaign has.
    """

    def __init__(self, shots: Shots, batches: int) -> None:
        self.shots = shots
        self.forward = Forward(shots, batches)
        self.count = len(shots)
        free = shots.excitation is not Excitation.TAP
        self.unknown_mass = np.array([not math.isfinite(shot.mass_kg) for shot in shots.items]) & (not free)
        self.own = ["log_factor"]
        if free:
            self.own += ["speed_m_s", "shift_m"]
        if self.unknown_mass.any():
            self.own.append("mass_kg")
        self.sizes = np.diff(shots.bounds)

    def coordinates(self, effects: tuple[str, ...]) -> tuple[Coordinate, ...]:
        """Free numbers of the nominal plant and of some effects."""
        made = nominal(self.shots.excitation)
        for identifier in effects:
            made += of_effect(identifier, self.forward.batches)
        return made

    def parameters(self, effects: tuple[str, ...], at: Samples) -> Samples:
        """Parameter vector of the plant at some coordinates."""
        names = self.forward.names(effects)
        return vector(self.coordinates(effects), at, names, defaults(names))

    def residual(self, effects: tuple[str, ...], at: Samples, local: Local) -> Samples:
        """Whitened residuals, shape (N,)."""
        predicted = self.forward.samples(effects, self.parameters(effects, at), local)
        return (self.shots.values - predicted) * self.shots.weights

    def moved(self, local: Local, steps: Samples) -> Local:
        """Return each shot's own numbers after steps of shape (n, q) in the order of `own`."""
        changed = {name: getattr(local, name) for name in self.own}
        for column, name in enumerate(self.own):
            if name == "mass_kg":
                factor = np.exp(np.clip(steps[:, column], -0.3, 0.3))
                changed[name] = np.where(self.unknown_mass, changed[name] * factor, changed[name])
            elif name == "log_factor":
                changed[name] = np.clip(changed[name] + np.clip(steps[:, column], -0.7, 0.7), -3.0, 3.0)
            elif name == "speed_m_s":
                changed[name] = changed[name] + steps[:, column] * (changed[name] != 0.0)
            else:
                changed[name] = changed[name] + steps[:, column]
        return replace(local, **changed)

    def shared_derivatives(
        self, effects: tuple[str, ...], at: Samples, local: Local, base: Samples
    ) -> Samples:
        """Differentiate the whitened prediction, shape (p, N)."""
        coordinates = self.coordinates(effects)
        made = np.empty((len(coordinates), base.size))
        for column, coordinate in enumerate(coordinates):
            step = STEP * max(abs(at[column]), 0.1) if coordinate.form != "log" else STEP
            if at[column] + step > coordinate.upper:
                step = -step
            moved = at.copy()
            moved[column] += step
            made[column] = (base - self.residual(effects, moved, local)) / step
        return made

    def own_derivatives(
        self, effects: tuple[str, ...], at: Samples, local: Local, base: Samples, *, central: bool = False
    ) -> Samples:
        """Differentiate the whitened prediction by each shot's own numbers, shape (q, N)."""
        made = np.empty((len(self.own), base.size))
        for column, name in enumerate(self.own):
            if name == "shift_m":
                made[column] = self.shots.weights * (self.shots.channel == 1)
                continue
            steps = np.zeros((self.count, len(self.own)))
            size = STEP if name != "speed_m_s" else STEP * max(float(np.abs(local.speed_m_s).max()), 1e-3)
            # A part that starts at rest stays there until it breaks away: its speed is no free number.
            steps[:, column] = size if name != "speed_m_s" else size * (local.speed_m_s != 0.0)
            ahead = self.residual(effects, at, self.moved(local, steps))
            if central:
                made[column] = (self.residual(effects, at, self.moved(local, -steps)) - ahead) / (2.0 * size)
            else:
                made[column] = (base - ahead) / size
        return made

    def first_local(self, share: float = 1.0) -> Local:
        """Where a fit starts from: initial speeds by a parabola through the first `share` of each record.

        With a share of 0 every part starts at rest.
        """
        n = self.count
        mass = np.array([shot.mass_kg for shot in self.shots.items])
        known = mass[np.isfinite(mass)]
        mass = np.where(np.isfinite(mass), mass, float(np.median(known)) if len(known) else 1.0)
        speed = np.full(n, math.nan)
        shift = np.zeros(n)
        if self.shots.excitation is not Excitation.TAP:
            for i, shot in enumerate(self.shots.items):
                time, position = shot.times[1], shot.values[1]
                count = min(len(time), max(6, round(share * len(time))))
                _, slope, level = np.polyfit(time[:count], position[:count], 2)
                speed[i] = slope * shot.direction if share > 0.0 else 0.0
                shift[i] = level if share > 0.0 else float(position[:count].mean())
        return Local(np.zeros(n), mass, speed, shift)


@dataclass(frozen=True, slots=True, eq=False)
class _Point:
    at: Samples
    local: Local
    residual: Samples
    cost: float


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
    point = _settle(problem, effects, _point(problem, effects, at, local, spread), spread)
    if not point.cost < math.inf:
        raise DiscrepancyError(
            f"the plant with {', '.join(effects) or 'no effect'} has no answer at the start"
        )
    limits = (lower, upper)
    point = _recentred(coordinates, point, spread)
    point, spread = _descend(problem, effects, point, spread, limits, (most_steps, tolerance))
    if most_steps >= WHOLE:
        for _ in range(RESCUES):
            if not _stuck(problem, effects, point, spread):
                break
            before = point.cost
            point = _recentred(coordinates, _rescued(problem, effects, point, spread, limits), spread)
            point, spread = _descend(problem, effects, point, spread, limits, (most_steps, tolerance))
            if point.cost > before - 1.0:
                break
    return Fit(effects, coordinates, point.at, point.local, spread, point.residual)


def _recentred(coordinates: tuple[Coordinate, ...], point: _Point, spread: float) -> _Point:
    """Move what all friction factors have in common into mu_k, which leaves every trace as it is."""
    place = next(i for i, one in enumerate(coordinates) if one.parameter == "mu_k" and not one.effect)
    common = float(np.median(point.local.log_factor))
    moved = min(max(float(point.at[place]) + common, coordinates[place].lower), coordinates[place].upper)
    common = moved - float(point.at[place])
    at = point.at.copy()
    at[place] = moved
    local = replace(point.local, log_factor=point.local.log_factor - common)
    return _Point(at, local, point.residual, _cost(point.residual, local, spread))


def _rescued(
    problem: Problem, effects: tuple[str, ...], point: _Point, spread: float, limits: tuple[Samples, Samples]
) -> _Point:
    """Start the stuck shots again, at shared parameters to which only the other shots are fitted.

    A few shots whose events come in another order hold up the fit of all: every step that helps the others
    makes them worse.
    """
    again = _begin(problem, effects, point.at, spread, (0.0, -spread, spread))
    point = _better_of(problem, point, again, spread)
    misfit = np.add.reduceat(point.residual**2, problem.shots.bounds[:-1]) / problem.sizes
    good = np.flatnonzero(misfit <= FAR * float(np.median(misfit)))
    if len(good) == problem.count or len(good) < 0.6 * problem.count:
        return point
    part = Problem(problem.shots.chosen(good), problem.forward.batches)
    local = Local(
        *(getattr(point.local, name)[good] for name in ("log_factor", "mass_kg", "speed_m_s", "shift_m"))
    )
    start = _point(part, effects, point.at, local, spread)
    found, _ = _descend(part, effects, start, spread, limits, (WHOLE, 1.0))
    other = _begin(problem, effects, found.at, spread, (0.0, -spread, spread))
    return other if other.cost < point.cost else point


def _stuck(problem: Problem, effects: tuple[str, ...], point: _Point, spread: float) -> bool:
    """Whether some shot's own numbers are not at their optimum: the cost would still fall to first order."""
    misfit = np.add.reduceat(point.residual**2, problem.shots.bounds[:-1]) / problem.sizes
    if float(np.median(misfit)) > NOT_IT:
        return False
    Jl = problem.own_derivatives(effects, point.at, point.local, point.residual)
    _, _, blocks = _normal(problem, np.empty((0, point.residual.size)), Jl, point, spread)
    promise = np.einsum("iq,iqr,ir->i", blocks.gradient, blocks.inverse, blocks.gradient)
    return bool((promise > PROMISE).any())


def _descend(
    problem: Problem,
    effects: tuple[str, ...],
    point: _Point,
    spread: float,
    limits: tuple[Samples, Samples],
    budget: tuple[int, float],
) -> tuple[_Point, float]:
    """Damped Gauss-Newton steps until the cost no longer falls."""
    lower, upper = limits
    most_steps, tolerance = budget
    damping = 1e-3
    calm = 0
    for _ in range(most_steps):
        J = problem.shared_derivatives(effects, point.at, point.local, point.residual)
        Jl = problem.own_derivatives(effects, point.at, point.local, point.residual)
        H, g, blocks = _normal(problem, J, Jl, point, spread)
        taken = False
        for _attempt in range(8):
            free = ~(((point.at <= lower) & (g < 0.0)) | ((point.at >= upper) & (g > 0.0)))
            step = np.zeros_like(point.at)
            scaled = H[np.ix_(free, free)].copy()
            scale = np.maximum(np.diag(scaled), 1e-12 * max(float(np.diag(H).max()), 1e-300))
            scaled[np.diag_indices_from(scaled)] += damping * scale
            step[free] = np.linalg.lstsq(scaled, g[free], rcond=None)[0]
            there = np.clip(point.at + step, lower, upper)
            own = _own_steps(blocks, there - point.at)
            trial = _point(problem, effects, there, problem.moved(point.local, own), spread)
            trial = _correct(problem, effects, trial, Jl, blocks, spread)
            if trial.cost < point.cost:
                taken = True
                break
            damping *= 10.0
            if damping > GIVES_UP:
                break
        if not taken:
            break
        gain = point.cost - trial.cost
        point = trial
        damping = max(damping / 8.0, 1e-9)
        fresh = max(float(np.sqrt(np.mean(point.local.log_factor**2))), SMALLEST_SPREAD)
        moved = abs(math.log(fresh / spread))
        spread = fresh
        point = replace(point, cost=_cost(point.residual, point.local, spread))
        # A model that is far from the floor need not be found to the last digit.
        excess = max(point.cost - point.residual.size, 0.0)
        calm = calm + 1 if gain < max(tolerance, HOPELESS * excess) and moved < 0.01 else 0
        if calm > (gain >= tolerance):
            break
    return point, spread


def refit_own(problem: Problem, model: Fit) -> Fit:
    """Keep the shared parameters of `model` and fit only what every shot of `problem` has of its own."""
    point = _begin(problem, model.effects, model.at, 1e3, (0.0, -model.spread, model.spread))
    return replace(model, local=point.local, residual=point.residual)


def begin(problem: Problem, effects: tuple[str, ...], at: Samples, steps: int = THOROUGH) -> Local:
    """Fit what every shot has of its own from several starts; the best of them shot by shot."""
    return _begin(problem, effects, at, FIRST_SPREAD, steps=steps).local


def _begin(
    problem: Problem,
    effects: tuple[str, ...],
    at: Samples,
    spread: float,
    factors: tuple[float, ...] = (0.0,),
    steps: int = THOROUGH,
) -> _Point:
    shares = {
        Excitation.TAP: (1.0,),
        Excitation.FREE_SLIDE: (1.0, 0.3),
        Excitation.DRIVEN: (0.02, 0.05, 0.15, 0.0),
    }
    best: _Point | None = None
    for share in shares[problem.shots.excitation]:
        first = problem.first_local(share)
        for factor in factors:
            start = replace(first, log_factor=first.log_factor + factor)
            point = _settle(problem, effects, _point(problem, effects, at, start, spread), spread, steps)
            best = point if best is None else _better_of(problem, best, point, spread)
    if best is None:
        raise AssertionError(problem.shots.excitation)
    return best


def _cost(residual: Samples, local: Local, spread: float) -> float:
    cost = float(np.einsum("i,i->", residual, residual)) + float(np.sum((local.log_factor / spread) ** 2))
    return cost if math.isfinite(cost) else math.inf


def _point(problem: Problem, effects: tuple[str, ...], at: Samples, local: Local, spread: float) -> _Point:
    residual = problem.residual(effects, at, local)
    return _Point(at, local, residual, _cost(residual, local, spread))


@dataclass(frozen=True, slots=True, eq=False)
class _Blocks:
    inverse: Samples  # (n, q, q)
    cross: Samples  # (n, q, p)
    gradient: Samples  # (n, q)


def _normal(
    problem: Problem, J: Samples, Jl: Samples, point: _Point, spread: float
) -> tuple[Samples, Samples, _Blocks]:
    """Set up the normal equations of the shared coordinates, each shot's own eliminated."""
    n, q, p = problem.count, len(Jl), len(J)
    A = np.empty((n, q, q))
    C = np.empty((n, q, p))
    gl = np.empty((n, q))
    H = np.zeros((p, p))
    g = np.zeros(p)
    for i in range(n):
        part = problem.shots.of(i)
        Ji, Li, ri = J[:, part], Jl[:, part], point.residual[part]
        H += Ji @ Ji.T
        g += Ji @ ri
        A[i] = Li @ Li.T
        C[i] = Li @ Ji.T
        gl[i] = Li @ ri
    A[:, 0, 0] += 1.0 / spread**2
    gl[:, 0] -= point.local.log_factor / spread**2
    diagonal = np.einsum("iqq->iq", A)
    A[:, np.arange(q), np.arange(q)] += 1e-10 * diagonal + (diagonal == 0.0)
    inverse = np.asarray(np.linalg.inv(A), dtype=np.float64)
    H -= np.einsum("iqa,iqr,irb->ab", C, inverse, C, optimize=True)
    g -= np.einsum("iqa,iqr,ir->a", C, inverse, gl, optimize=True)
    return H, g, _Blocks(inverse, C, gl)


def _own_steps(blocks: _Blocks, step: Samples) -> Samples:
    steps: Samples = np.einsum("iqr,ir->iq", blocks.inverse, blocks.gradient - blocks.cross @ step)
    return steps


def _correct(
    problem: Problem, effects: tuple[str, ...], trial: _Point, Jl: Samples, blocks: _Blocks, spread: float
) -> _Point:
    """One step of every shot's own numbers at the new shared ones; kept where it helps the shot."""
    if not trial.cost < math.inf:
        return trial
    gradient = np.add.reduceat(Jl * trial.residual, problem.shots.bounds[:-1], axis=1).T
    gradient[:, 0] -= trial.local.log_factor / spread**2
    moved = problem.moved(trial.local, np.einsum("iqr,ir->iq", blocks.inverse, gradient))
    return _better_of(problem, trial, _point(problem, effects, trial.at, moved, spread), spread)


def _better_of(problem: Problem, old: _Point, new: _Point, spread: float) -> _Point:
    def each(point: _Point) -> Samples:
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
    return _Point(new.at, local, residual, _cost(residual, local, spread))


def _settle(
    problem: Problem, effects: tuple[str, ...], point: _Point, spread: float, steps: int = 3
) -> _Point:
    """Fit every shot's own numbers at fixed shared ones."""
    for _ in range(steps):
        if not point.cost < math.inf:
            return point
        Jl = problem.own_derivatives(effects, point.at, point.local, point.residual)
        none = np.empty((0, point.residual.size))
        _, _, blocks = _normal(problem, none, Jl, point, spread)
        steps_of = _own_steps(blocks, np.empty(0))
        new = point
        for scale in (1.0, 0.3, 0.1):
            # Shorter steps for the shots that the whole step did not help; the best so far is kept.
            moved = problem.moved(point.local, scale * steps_of)
            new = _better_of(problem, new, _point(problem, effects, point.at, moved, spread), spread)
            if steps < THOROUGH:
                break
        if point.cost - new.cost < 1e-3:
            return new
        point = new
    return point
