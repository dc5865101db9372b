"""Which phase of its shot every sample belongs to, by the fitted model."""

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.data.shots import IndexArray
from impactcell.discrepancy.model.fit import Fit
from impactcell.discrepancy.model.forward import Trajectory
from impactcell.discrepancy.model.problem import Problem
from impactcell.records import Samples

PHASES = ("preload", "loading", "unloading", "free_slide", "stop", "driven")
PRELOAD, LOADING, UNLOADING, FREE_SLIDE, STOP, DRIVEN = range(6)
BETWEEN_SHOTS = "between_shots"


def trajectory_of(problem: Problem, fit: Fit) -> Trajectory:
    """Course of the fitted model at every sample."""
    return problem.forward.trajectory(
        fit.effects, problem.parameters(fit.effects, fit.theta), fit.shot_parameters
    )


def sample_phases(problem: Problem, trajectory: Trajectory) -> IndexArray:
    """Phase of every sample, shape (N,), an index into `PHASES`.

    Preload lasts from contact to breakaway; loading while the contact is being compressed, unloading while it
    relaxes; free slide from there to rest. What the actuator does to a part that has stopped is `stop`.
    """
    shots = problem.shots
    if shots.excitation is Excitation.DRIVEN:
        return np.full(shots.values.size, DRIVEN, dtype=np.int64)
    phase = np.full(shots.values.size, STOP, dtype=np.int64)
    moving = np.abs(trajectory.speed_m_s) > 0.0
    if shots.excitation is Excitation.FREE_SLIDE:
        phase[moving] = FREE_SLIDE
        return phase
    touching = trajectory.actuator_displacement_m - trajectory.part_displacement_m > 0.0
    velocity = np.repeat([shot.velocity_m_s for shot in shots.items], np.diff(shots.bounds))
    closing = velocity > trajectory.speed_m_s
    still = ~moving & (trajectory.part_displacement_m <= 1e-12)
    phase[moving & ~touching] = FREE_SLIDE
    phase[moving & touching & ~closing] = UNLOADING
    phase[moving & touching & closing] = LOADING
    phase[still] = PRELOAD
    return phase


def phase_positions(problem: Problem, phase: IndexArray, times: Samples) -> Samples:
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
