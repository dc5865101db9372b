"""What a free-form term may depend on: each covariate at every sample, and the range gone through."""

from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.data import PHASES
from impactcell.discrepancy.model import Fit, Problem, sample_phases, trajectory_of
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


@dataclass(frozen=True, slots=True, eq=False)
class Visited:
    """A covariate over all shots.

    Attributes
    ----------
    lower, upper : float
        Range in which it was met.
    values : ndarray, shape (n,)
        At the samples at which the term acts; of a column of `shots.csv` a value a shot.
    """

    lower: float
    upper: float
    values: Samples


def visited(problem: Problem, model: Fit, form: FreeForm) -> Visited | None:
    """Range of a form's covariate under a fitted model; None where it was not, or hardly, gone through."""
    if form.is_between_shots:
        return _of_shots(problem, form)
    trajectory = trajectory_of(problem, model)
    phases = np.array(PHASES)[sample_phases(problem, trajectory)]
    items, sizes = problem.shots.items, problem.sizes
    where = {"gap": AFTER, "speed": SLIDING, "position": SLIDING}.get(form.covariate, TOUCHING)
    acts = np.isin(phases, sorted(where))
    direction = np.repeat([float(shot.direction) for shot in items], sizes)
    indentation = trajectory.actuator_displacement_m - trajectory.part_displacement_m
    if form.covariate == "force":
        acts &= problem.shots.channel == 0
    if not acts.any():
        return None
    if form.covariate == "speed":
        values = np.abs(trajectory.speed_m_s)
    elif form.covariate == "position":
        start = np.repeat([shot.start_m for shot in items], sizes)
        values = start + direction * trajectory.part_displacement_m
    elif form.covariate == "indentation":
        values = indentation
    elif form.covariate == "indentation_rate":
        values = np.repeat([shot.velocity_m_s for shot in items], sizes) - trajectory.speed_m_s
    elif form.covariate == "gap":
        values = -indentation
    elif form.covariate == "force":
        values = problem.shots.values * np.where(problem.shots.channel == 0, 1.0, 0.0)
    else:
        values = problem.shots.times
    return _range(values[acts], form)


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
