"""Which phase of its shot every sample belongs to, by the fitted model."""

import numpy as np

from impactcell.discrepancy.data import PHASES, IndexArray, Trajectory
from impactcell.discrepancy.model.least_squares import Fit
from impactcell.discrepancy.model.problem import Problem
from impactcell.records import Samples

SHORTEST_PHASE_S = 1e-12
"""Duration [s] that a phase of a single sample is given."""


def trajectory_of(problem: Problem, fit: Fit) -> Trajectory:
    """Trajectory of the fitted model at every sample."""
    model = problem.with_effects(fit.effects)
    return model.forward.trajectory(fit.effects, model.plant_parameters(fit.theta), fit.shot_parameters)


def sample_phases(problem: Problem, trajectory: Trajectory) -> IndexArray:
    """Phase of every sample, shape (N,), an index into `PHASES`."""
    return problem.shots.excitation.sample_phases(problem.shots, trajectory)


def phase_positions(problem: Problem, phase: IndexArray, times: Samples) -> Samples:
    """Place of every sample within its phase, 0 to 1 in time, shape (N,)."""
    shots = problem.shots
    owner = np.repeat(np.arange(len(shots)), np.diff(shots.bounds))
    key = owner * len(PHASES) + phase
    first = np.full(len(shots) * len(PHASES), np.inf)
    last = np.full(len(shots) * len(PHASES), -np.inf)
    np.minimum.at(first, key, times)
    np.maximum.at(last, key, times)
    width = np.maximum(last[key] - first[key], SHORTEST_PHASE_S)
    position: Samples = (times - first[key]) / width
    return position
