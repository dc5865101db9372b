"""Contact and slide of a tap fitted each alone: what the model cannot follow even then is where a gap arises.

What goes wrong in the contact is carried on into the slide, and a fit of whole shots spreads what goes wrong
in the slide over the contact. Cut apart at the separation, a slide of its own has its own initial speed, and
a contact no slide to pay for: only the part in which something is missing stays above the floor.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.data.shots import POSITION, Shot, lay_out
from impactcell.discrepancy.model.fit import Fit, begin, fit
from impactcell.discrepancy.model.phases import course_of
from impactcell.discrepancy.model.problem import Problem
from impactcell.errors import DiscrepancyError

CLEAR = 0.1
"""Share of the contact's duration left out after it: the model need not know the separation to the sample."""

FEWEST_SAMPLES = 12
FEWEST_SHOTS = 3


@dataclass(frozen=True, slots=True)
class Alone:
    """RMS over the sensors' noise of contact and slide fitted alone; nan where it could not be fitted."""

    contact: float
    slide: float


def alone(problem: Problem, nominal: Fit) -> Alone:
    """Fit the contacts and the slides of taps apart from each other.

    Parameters
    ----------
    problem : Problem
        Taps.
    nominal : Fit
        Fitted to whole shots: says when part and actuator separate, and where the fits start.
    """
    course = course_of(problem, nominal)
    touching = course.travel_m > course.advance_m
    times = problem.shots.times
    parts = [problem.shots.of(shot) for shot in range(problem.count)]
    ends = [float(times[part][touching[part]].max(initial=0.0)) for part in parts]
    shots = list(zip(problem.shots.items, ends, strict=True))
    contacts = [_until(shot, end) for shot, end in shots if end > 0.0]
    slides = [_after(shot, (1.0 + CLEAR) * end) for shot, end in shots]
    return Alone(
        _floors(problem, nominal, Excitation.TAP, contacts),
        _floors(problem, nominal, Excitation.FREE_SLIDE, slides),
    )


def _until(shot: Shot, end: float) -> Shot:
    force, position, actuator = (times <= end for times in shot.times)
    return replace(
        shot,
        times=(shot.times[0][force], shot.times[1][position], shot.times[2][actuator]),
        values=(shot.values[0][force], shot.values[1][position], shot.values[2][actuator]),
    )


def _after(shot: Shot, begin_s: float) -> Shot:
    kept = shot.times[POSITION] > begin_s
    none = np.empty(0)
    times = shot.times[POSITION][kept]
    return replace(
        shot,
        times=(none, times - times[:1], none),
        values=(none, shot.values[POSITION][kept], none),
    )


def _floors(problem: Problem, nominal: Fit, excitation: Excitation, items: list[Shot]) -> float:
    items = [shot for shot in items if shot.size >= FEWEST_SAMPLES]
    if len(items) < FEWEST_SHOTS:
        return math.nan
    whole = problem.shots
    shots = lay_out(excitation, whole.gravity_m_s2, whole.stroke_m, tuple(items), whole.noise_std)
    part = Problem(shots, problem.forward.batches)
    known = dict(zip(nominal.coordinates, nominal.at, strict=True))
    start = np.array([known[one] for one in part.coordinates(nominal.effects)])
    try:
        found = fit(part, nominal.effects, start, begin(part, nominal.effects, start))
    except DiscrepancyError:
        return math.nan
    free = shots.values.size - len(part.own) * part.count - len(start)
    return math.sqrt(float(found.misfit(shots).sum()) / max(free, 1))
