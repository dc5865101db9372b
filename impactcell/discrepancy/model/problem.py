"""One set of shots to be fitted: residuals and their derivatives, and where a fit starts."""

import math
from dataclasses import replace

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.data.shots import ShotSet
from impactcell.discrepancy.model.forward import ForwardModel, ShotParameters
from impactcell.discrepancy.model.parameters import (
    Coordinate,
    default_parameters,
    effect_coordinates,
    nominal_coordinates,
    plant_parameters,
)
from impactcell.records import Samples

DIFFERENCE_STEP = 2e-5
JUMP_FACTOR = 20.0


class Problem:
    """One set of shots to be fitted; holds no state but the shots.

    Parameters
    ----------
    shots : Shots
    batches : int
        How many batches the whole campaign has.
    """

    def __init__(self, shots: ShotSet, batches: int) -> None:
        self.shots = shots
        self.forward = ForwardModel(shots, batches)
        self.count = len(shots)
        free = shots.excitation is not Excitation.TAP
        slides = shots.excitation is Excitation.FREE_SLIDE
        self.unknown_mass = np.array([not math.isfinite(shot.mass_kg) for shot in shots.items]) & (not slides)
        self.shot_parameter_names = ["log_factor"]
        if free:
            self.shot_parameter_names += ["speed_m_s", "shift_m"]
        if self.unknown_mass.any():
            self.shot_parameter_names.append("mass_kg")
        self.sizes = np.diff(shots.bounds)

    def coordinates(self, effects: tuple[str, ...]) -> tuple[Coordinate, ...]:
        """Free numbers of the nominal plant and of some effects."""
        coordinates = nominal_coordinates(self.shots.excitation)
        for identifier in effects:
            coordinates += effect_coordinates(identifier, self.forward.batches)
        return coordinates

    def parameters(self, effects: tuple[str, ...], theta: Samples) -> Samples:
        """Parameter vector of the plant at some coordinates."""
        names = self.forward.names(effects)
        return plant_parameters(self.coordinates(effects), theta, names, default_parameters(names))

    def residual(self, effects: tuple[str, ...], theta: Samples, shot_parameters: ShotParameters) -> Samples:
        """Whitened residuals, shape (N,)."""
        predicted = self.forward.samples(effects, self.parameters(effects, theta), shot_parameters)
        return self.shots.whiten(self.shots.values - predicted)

    def step_shot_parameters(self, shot_parameters: ShotParameters, steps: Samples) -> ShotParameters:
        """Return each shot's own numbers after steps of shape (n, q) in the order of `own`."""
        changed = {name: getattr(shot_parameters, name) for name in self.shot_parameter_names}
        for column, name in enumerate(self.shot_parameter_names):
            if name == "mass_kg":
                factor = np.exp(np.clip(steps[:, column], -0.3, 0.3))
                changed[name] = np.where(self.unknown_mass, changed[name] * factor, changed[name])
            elif name == "log_factor":
                changed[name] = np.clip(changed[name] + np.clip(steps[:, column], -0.7, 0.7), -3.0, 3.0)
            elif name == "speed_m_s":
                changed[name] = changed[name] + steps[:, column] * (changed[name] != 0.0)
            else:
                changed[name] = changed[name] + steps[:, column]
        return replace(shot_parameters, **changed)

    def shared_jacobian(
        self, effects: tuple[str, ...], theta: Samples, shot_parameters: ShotParameters, base: Samples
    ) -> Samples:
        """Differentiate the whitened prediction, shape (p, N)."""
        coordinates = self.coordinates(effects)
        jacobian = np.empty((len(coordinates), base.size))
        for column, coordinate in enumerate(coordinates):
            step = (
                DIFFERENCE_STEP * max(abs(theta[column]), 0.1)
                if coordinate.form != "log"
                else DIFFERENCE_STEP
            )
            if theta[column] + step > coordinate.upper:
                step = -step
            moved = theta.copy()
            moved[column] += step
            jacobian[column] = remove_jumps(base - self.residual(effects, moved, shot_parameters)) / step
        return jacobian

    def shot_jacobian(
        self,
        effects: tuple[str, ...],
        theta: Samples,
        shot_parameters: ShotParameters,
        base: Samples,
        *,
        central: bool = False,
    ) -> Samples:
        """Differentiate the whitened prediction by each shot's own numbers, shape (q, N)."""
        jacobian = np.empty((len(self.shot_parameter_names), base.size))
        for column, name in enumerate(self.shot_parameter_names):
            if name == "shift_m":
                jacobian[column] = self.shots.whiten((self.shots.channel == 1).astype(np.float64))
                continue
            steps = np.zeros((self.count, len(self.shot_parameter_names)))
            size = (
                DIFFERENCE_STEP
                if name != "speed_m_s"
                else DIFFERENCE_STEP * max(float(np.abs(shot_parameters.speed_m_s).max()), 1e-3)
            )
            # A part that starts at rest stays there until it breaks away: its speed is no free number.
            steps[:, column] = size if name != "speed_m_s" else size * (shot_parameters.speed_m_s != 0.0)
            ahead = self.residual(effects, theta, self.step_shot_parameters(shot_parameters, steps))
            if central:
                back = self.residual(effects, theta, self.step_shot_parameters(shot_parameters, -steps))
                jacobian[column] = remove_jumps(back - ahead) / (2.0 * size)
            else:
                jacobian[column] = remove_jumps(base - ahead) / size
        return jacobian

    def initial_shot_parameters(self, share: float = 1.0) -> ShotParameters:
        """Where a fit starts from: initial speeds by a parabola through the first `share` of each record.

        With a share of 0 a driven block starts with the speed that was measured.
        """
        n = self.count
        mass = np.array([shot.mass_kg for shot in self.shots.items])
        stated = mass[np.isfinite(mass)]
        mass = np.where(np.isfinite(mass), mass, float(np.median(stated)) if len(stated) else 1.0)
        if self.shots.excitation is Excitation.DRIVEN:
            mass = np.array([shot.covariates["mass"] for shot in self.shots.items])
        speed = np.full(n, math.nan)
        shift = np.zeros(n)
        if self.shots.excitation is not Excitation.TAP:
            for i, shot in enumerate(self.shots.items):
                time, position = shot.times[1], shot.values[1]
                count = min(len(time), max(6, round(share * len(time))))
                _, slope, level = np.polyfit(time[:count], position[:count], 2)
                speed[i] = slope * shot.direction
                shift[i] = level
                if share <= 0.0:
                    speed[i] = shot.covariates["initial_speed"] * shot.direction
                    shift[i] = position[0]
        return ShotParameters(np.zeros(n), mass, speed, shift)


def remove_jumps(change: Samples) -> Samples:
    """Take out, in place, single samples in which a tiny step of a parameter changed the prediction a lot.

    The contact force jumps to b v when the contact closes. A sample that the jump passes during the step says
    nothing about the slope, but divided by the step it would outweigh all others.
    """
    size = np.abs(change)
    if not (size > 1.0).any():
        return change
    beside = np.maximum(size[:-2], size[2:])
    change[1:-1][size[1:-1] > JUMP_FACTOR * beside + 1.0] = 0.0
    return change
