"""What a free-form term may depend on: each covariate at every sample, and the range gone through."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from impactcell.discrepancy.data import PHASES, Trajectory
from impactcell.discrepancy.model import Fit, Problem, sample_phases, trajectory_of
from impactcell.physics import LawKind
from impactcell.physics.free_form import FreeForm
from impactcell.records import Samples

SLIDING = frozenset({"loading", "unloading", "free_slide", "driven"})
"""Phases in which the part slides."""
TOUCHING = frozenset({"preload", "loading", "unloading"})
"""Phases in which the actuator touches it."""
AFTER = frozenset({"free_slide"})
"""Phase in which a pull over the gap may act."""
FEWEST_SAMPLES = 50
"""Samples below which a covariate has not been gone through: five a coefficient of a spline."""
FEWEST_VALUES = 8
"""Different values of a column of `shots.csv` below which a bend of its function is a guess. Own choice."""
LEAST_VARIETY = 0.2
"""Share of its largest magnitude over which a covariate has to vary: a function of what hardly changes is a
number, and what it does elsewhere is unknown. Own choice."""
MOST_SHARED = 0.95
"""Share of the variance of a second covariate that a cubic of the first may explain: beyond it a function of
both is one of the first alone, as far as anybody can tell. Own choice."""
WHERE = {"gap": AFTER, "speed": SLIDING, "position": SLIDING}
"""Phases in which a term over a covariate acts; any other number of the motion in contact."""


@dataclass(frozen=True, slots=True, eq=False)
class Visited:
    """A covariate over all shots.

    Attributes
    ----------
    lower, upper : float
        Range in which it was met.
    values : ndarray, shape (n,)
        At the samples at which the term acts; of a column of `shots.csv` a value a shot.
    second : Visited or None
        The second covariate at the same samples; None where there is one alone.
    power : ndarray, shape (n,) or None
        What a dissipative function is multiplied with in the power that it takes at those samples, but for
        what is the same at all of them; None where it need not dissipate.
    """

    lower: float
    upper: float
    values: Samples
    second: "Visited | None" = None
    power: Samples | None = None

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """Range of each covariate."""
        return ((self.lower, self.upper), *(self.second.ranges if self.second else ()))

    @property
    def points(self) -> Samples:
        """Values, shape (n,); of two covariates shape (n, 2)."""
        if self.second is None:
            return self.values
        return np.column_stack([self.values, self.second.values])


def visited(problem: Problem, model: Fit, form: FreeForm) -> Visited | None:
    """Range of a form's covariates under a fitted model; None where one was not, or hardly, gone through."""
    if form.is_between_shots:
        return _of_shots(problem, form)
    trajectory = trajectory_of(problem, model)
    phases = np.array(PHASES)[sample_phases(problem, trajectory)]
    acts = np.isin(phases, sorted(WHERE.get(form.covariate, TOUCHING)))
    if form.covariate == "force":
        acts &= problem.shots.channel == 0
    if not acts.any():
        return None
    first = _range(_values(problem, trajectory, form.covariate)[acts], form)
    if first is not None and form.dissipates:
        first = replace(first, power=_power(problem, trajectory, form)[acts])
    if not form.second or first is None:
        return first
    second = _second(problem, trajectory, form, acts)
    if second is None or _is_function_of(first.values, second.values):
        return None
    return replace(first, second=second)


def _values(problem: Problem, trajectory: Trajectory, covariate: str) -> Samples:
    """Evaluate a number of the motion at every sample, shape (N,)."""
    items, sizes = problem.shots.items, problem.sizes
    if covariate == "speed":
        return np.abs(trajectory.speed_m_s)
    if covariate == "position":
        start = np.repeat([shot.start_m for shot in items], sizes)
        direction = np.repeat([float(shot.direction) for shot in items], sizes)
        position: Samples = start + direction * trajectory.part_displacement_m
        return position
    if covariate == "indentation_rate":
        return np.repeat([shot.velocity_m_s for shot in items], sizes) - trajectory.speed_m_s
    if covariate == "force":
        force: Samples = problem.shots.values * np.where(problem.shots.channel == 0, 1.0, 0.0)
        return force
    if covariate == "time":
        return problem.shots.times
    indentation = trajectory.actuator_displacement_m - trajectory.part_displacement_m
    return -indentation if covariate == "gap" else indentation


def _power(problem: Problem, trajectory: Trajectory, form: FreeForm) -> Samples:
    """Power that a function of one takes at every sample, shape (N,); friction's over the load."""
    if form.law_kind is LawKind.KINETIC:
        return np.abs(trajectory.speed_m_s)
    relative = "indentation_rate" if form.law_kind is LawKind.CONTACT else "speed"
    power: Samples = _values(problem, trajectory, relative) ** 2
    return power


def _second(
    problem: Problem, trajectory: Trajectory, form: FreeForm, acts: NDArray[np.bool_]
) -> Visited | None:
    """Range of the second covariate where a term acts."""
    alone = replace(form, covariate=form.second, second="")
    if not form.effect.columns:
        return _range(_values(problem, trajectory, form.second)[acts], alone)
    column = _of_shots(problem, alone)
    return column and replace(column, values=np.repeat(column.values, problem.sizes)[acts])


def _is_function_of(u: Samples, w: Samples) -> bool:
    """Whether a cubic of the first covariate explains all but a little of the second."""
    scaled = (u - u.mean()) / max(float(u.std()), 1e-300)
    left = w - np.polynomial.Polynomial.fit(scaled, w, 3)(scaled)
    return float(left.var()) <= (1.0 - MOST_SHARED) * float(w.var())


def poor_columns(problem: Problem) -> tuple[str, ...]:
    """Further columns of `shots.csv` with too few different values for a function of them."""
    names = dict.fromkeys(name for shot in problem.shots.items for name, _ in shot.columns)
    values = {name: {shot.covariates.get(name) for shot in problem.shots.items} for name in names}
    return tuple(name for name, met in values.items() if len(met) < FEWEST_VALUES)


def _of_shots(problem: Problem, form: FreeForm) -> Visited | None:
    """Range of a column of `shots.csv`; None where it is not known of every shot, or hardly varies."""
    values = np.array([shot.covariates.get(form.covariate, np.nan) for shot in problem.shots.items])
    if not np.isfinite(values).all() or np.unique(values).size < FEWEST_VALUES:
        return None
    return Visited(float(values.min()), float(values.max()), values)


def _range(values: Samples, form: FreeForm) -> Visited | None:
    if len(values) < FEWEST_SAMPLES:
        return None
    lower, upper = float(values.min()), float(values.max())
    if form.covariate in {"speed", "indentation", "gap", "time", "force"}:
        lower = min(0.0, lower) if form.covariate == "force" else 0.0
    largest = max(abs(lower), abs(upper))
    if upper - lower < LEAST_VARIETY * largest or upper <= lower:
        return None
    return Visited(lower, upper, values)
