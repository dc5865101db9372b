"""Which phase of its shot every sample belongs to, by the fitted model."""

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.data.shots import Index
from impactcell.discrepancy.model.fit import Fit
from impactcell.discrepancy.model.forward import Course
from impactcell.discrepancy.model.problem import Problem
from impactcell.records import Samples

PHASES = ("preload", "loading", "unloading", "free_slide", "stop", "driven")
PRELOAD, LOADING, UNLOADING, FREE_SLIDE, STOP, DRIVEN = range(6)
BETWEEN_SHOTS = "between_shots"


def course_of(problem: Problem, fit: Fit) -> Course:
    """Course of the fitted model at every sample."""
    return problem.forward.course(fit.effects, problem.parameters(fit.effects, fit.at), fit.local)


def phases(problem: Problem, course: Course) -> Index:
    """Phase of every sample, shape (N,), an index into `PHASES`.

    Preload lasts from contact to breakaway; loading while the contact is being compressed, unloading while it
    relaxes; free slide from there to rest. What the actuator does to a part that has stopped is `stop`.
    """
    shots = problem.shots
    if shots.excitation is Excitation.DRIVEN:
        return np.full(shots.values.size, DRIVEN, dtype=np.int64)
    made = np.full(shots.values.size, STOP, dtype=np.int64)
    moving = np.abs(course.speed_m_s) > 0.0
    if shots.excitation is Excitation.FREE_SLIDE:
        made[moving] = FREE_SLIDE
        return made
    touching = course.travel_m - course.advance_m > 0.0
    velocity = np.repeat([shot.velocity_m_s for shot in shots.items], np.diff(shots.bounds))
    closing = velocity > course.speed_m_s
    still = ~moving & (course.advance_m <= 1e-12)
    made[moving & ~touching] = FREE_SLIDE
    made[moving & touching & ~closing] = UNLOADING
    made[moving & touching & closing] = LOADING
    made[still] = PRELOAD
    return made


def place_within(problem: Problem, phase: Index, times: Samples) -> Samples:
    """Place of every sample within its phase, 0 to 1 in time, shape (N,)."""
    shots = problem.shots
    owner = np.repeat(np.arange(len(shots)), np.diff(shots.bounds))
    key = owner * len(PHASES) + phase
    first = np.full(len(shots) * len(PHASES), np.inf)
    last = np.full(len(shots) * len(PHASES), -np.inf)
    np.minimum.at(first, key, times)
    np.maximum.at(last, key, times)
    width = np.maximum(last[key] - first[key], 1e-12)
    place: Samples = (times - first[key]) / width
    return place
