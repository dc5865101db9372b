"""Open-loop simulation of held-out shots: what an engineer means by the error of a model.

Friction is that of the model, not the shot's own; only the state in which a shot begins is fitted, where the
record does not begin at rest. Velocity and mass are as told, or off that by what they are in the mean of the
training shots.
"""

import math
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.data import CHANNELS, FORCE, POSITION
from impactcell.discrepancy.model import Fit, Problem, settings_on_average, simulate_open_loop
from impactcell.records import Samples

UNITS = ("N", "m", "m")
"""Of force, position and actuator."""


@dataclass(frozen=True, slots=True)
class SimulationError:
    """Error of one model.

    Attributes
    ----------
    rmse : float
        In the channel's unit.
    fit_percent : float
        100 (1 - |y - y_sim| / |y - mean y|), means shot by shot (Ljung, System Identification, 1999).
    relative_force : float
        RMS error of the force over its RMS; nan where the force is no output.
    """

    rmse: float
    fit_percent: float
    relative_force: float


@dataclass(frozen=True, slots=True)
class Simulation:
    """Error of nominal and final model in the same channel."""

    channel: str
    unit: str
    before: SimulationError
    after: SimulationError


def simulate_held_out(problem: Problem, before: Fit, after: Fit) -> Simulation:
    """Simulate held-out shots by two models, open loop; the position is judged where it was recorded."""
    channel = POSITION if (problem.shots.channel == POSITION).any() else FORCE
    return Simulation(
        CHANNELS[channel],
        UNITS[channel],
        _error(problem, before, channel),
        _error(problem, after, channel),
    )


def _error(problem: Problem, model: Fit, channel: int) -> SimulationError:
    missed = simulate_open_loop(settings_on_average(problem, model), model)
    shots = problem.shots
    inside, force = shots.channel == channel, shots.channel == FORCE
    variation = np.concatenate([_about_mean(shots.values[part][inside[part]]) for part in _parts(problem)])
    relative_force = _rms(missed[force]) / _rms(shots.values[force]) if force.any() else math.nan
    left = _rms(missed[inside])
    return SimulationError(left, 100.0 * (1.0 - left / max(_rms(variation), 1e-300)), relative_force)


def _parts(problem: Problem) -> list[slice]:
    return [problem.shots.samples_of(shot) for shot in range(problem.count)]


def _about_mean(values: Samples) -> Samples:
    return values - values.mean() if len(values) else values


def _rms(values: Samples) -> float:
    return float(np.sqrt(np.mean(values**2)))
