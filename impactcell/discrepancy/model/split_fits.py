"""Contact and slide of a tap fitted each alone: what the model cannot follow even then is where a gap arises.

What goes wrong in the contact is carried on into the slide, and a fit of whole shots spreads what goes wrong
in the slide over the contact. Cut apart at the separation, a slide of its own has its own initial speed, and
a contact no slide to pay for: only the part in which something is missing stays above the floor.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.discrepancy.data import (
    POSITION,
    ExcitationStrategy,
    FreeSlide,
    PreparedShot,
    concatenate_shots,
)
from impactcell.discrepancy.model.least_squares import Fit, fit, initial_shot_parameters
from impactcell.discrepancy.model.phase_of_samples import trajectory_of
from impactcell.discrepancy.model.problem import Problem
from impactcell.errors import DiscrepancyError

SEPARATION_MARGIN = 0.1
"""Share of the contact's duration left out after it: the model need not know the separation to the sample."""

MIN_SAMPLES = 12
"""Samples of a contact or slide below which it is left out: it has up to four numbers of its own."""
MIN_SHOTS = 3
"""Contacts or slides below which they are not fitted apart."""


@dataclass(frozen=True, slots=True)
class SplitFits:
    """RMS over the sensors' noise of contact and slide fitted alone; nan where it could not be fitted."""

    contact: float
    slide: float


def fit_split(problem: Problem, nominal: Fit) -> SplitFits:
    """Fit the contacts and the slides of taps apart from each other.

    Parameters
    ----------
    problem : Problem
        Taps.
    nominal : Fit
        Fitted to whole shots: says when part and actuator separate, and where the fits start.
    """
    trajectory = trajectory_of(problem, nominal)
    touching = trajectory.actuator_displacement_m > trajectory.part_displacement_m
    times = problem.shots.times
    parts = [problem.shots.samples_of(shot) for shot in range(problem.count)]
    ends = [float(times[part][touching[part]].max(initial=0.0)) for part in parts]
    shots = list(zip(problem.shots.items, ends, strict=True))
    contacts = [_contact_of(shot, end) for shot, end in shots if end > 0.0]
    slides = [_slide_of(shot, (1.0 + SEPARATION_MARGIN) * end) for shot, end in shots]
    return SplitFits(
        _rms_of_fit(problem, nominal, problem.shots.excitation, contacts),
        _rms_of_fit(problem, nominal, FreeSlide(), slides),
    )


def _contact_of(shot: PreparedShot, end: float) -> PreparedShot:
    force, position, actuator = (times <= end for times in shot.times)
    return replace(
        shot,
        times=(shot.times[0][force], shot.times[1][position], shot.times[2][actuator]),
        values=(shot.values[0][force], shot.values[1][position], shot.values[2][actuator]),
    )


def _slide_of(shot: PreparedShot, begin_s: float) -> PreparedShot:
    kept = shot.times[POSITION] > begin_s
    none = np.empty(0)
    times = shot.times[POSITION][kept]
    return replace(
        shot,
        times=(none, times - times[:1], none),
        values=(none, shot.values[POSITION][kept], none),
    )


def _rms_of_fit(
    problem: Problem, nominal: Fit, excitation: ExcitationStrategy, items: list[PreparedShot]
) -> float:
    items = [shot for shot in items if shot.size >= MIN_SAMPLES]
    if len(items) < MIN_SHOTS:
        return math.nan
    whole = problem.shots
    shots = concatenate_shots(excitation, whole.gravity_m_s2, whole.stroke_m, tuple(items), whole.noise_std)
    part = Problem(shots, problem.batches, nominal.effects)
    nominal_theta = dict(zip(nominal.coordinates, nominal.theta, strict=True))
    start = np.array([nominal_theta[coordinate] for coordinate in part.coordinates])
    try:
        fitted = fit(part, start, initial_shot_parameters(part, start))
    except DiscrepancyError:
        return math.nan
    free = shots.values.size - len(part.shot_parameter_names) * part.count - len(start)
    return math.sqrt(float(fitted.misfit(shots).sum()) / max(free, 1))
