"""One set of shots to be fitted: residuals and their derivatives, and where a fit starts."""

import math
from dataclasses import replace

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.data.shots import Shots
from impactcell.discrepancy.model.forward import Forward, Local
from impactcell.discrepancy.model.parameters import Coordinate, defaults, nominal, of_effect, vector
from impactcell.records import Samples

STEP = 2e-5
JUMP = 20.0


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
        slides = shots.excitation is Excitation.FREE_SLIDE
        self.unknown_mass = np.array([not math.isfinite(shot.mass_kg) for shot in shots.items]) & (not slides)
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
        return self.shots.whitened(self.shots.values - predicted)

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
            made[column] = without_jumps(base - self.residual(effects, moved, local)) / step
        return made

    def own_derivatives(
        self, effects: tuple[str, ...], at: Samples, local: Local, base: Samples, *, central: bool = False
    ) -> Samples:
        """Differentiate the whitened prediction by each shot's own numbers, shape (q, N)."""
        made = np.empty((len(self.own), base.size))
        for column, name in enumerate(self.own):
            if name == "shift_m":
                made[column] = self.shots.whitened((self.shots.channel == 1).astype(np.float64))
                continue
            steps = np.zeros((self.count, len(self.own)))
            size = STEP if name != "speed_m_s" else STEP * max(float(np.abs(local.speed_m_s).max()), 1e-3)
            # A part that starts at rest stays there until it breaks away: its speed is no free number.
            steps[:, column] = size if name != "speed_m_s" else size * (local.speed_m_s != 0.0)
            ahead = self.residual(effects, at, self.moved(local, steps))
            if central:
                back = self.residual(effects, at, self.moved(local, -steps))
                made[column] = without_jumps(back - ahead) / (2.0 * size)
            else:
                made[column] = without_jumps(base - ahead) / size
        return made

    def first_local(self, share: float = 1.0) -> Local:
        """Where a fit starts from: initial speeds by a parabola through the first `share` of each record.

        With a share of 0 a driven block starts with the speed that was measured.
        """
        n = self.count
        mass = np.array([shot.mass_kg for shot in self.shots.items])
        known = mass[np.isfinite(mass)]
        mass = np.where(np.isfinite(mass), mass, float(np.median(known)) if len(known) else 1.0)
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
        return Local(np.zeros(n), mass, speed, shift)


def without_jumps(change: Samples) -> Samples:
    """Take out, in place, single samples in which a tiny step of a parameter changed the prediction a lot.

    The contact force jumps to b v when the contact closes. A sample that the jump passes during the step says
    nothing about the slope, but divided by the step it would outweigh all others.
    """
    size = np.abs(change)
    if not (size > 1.0).any():
        return change
    beside = np.maximum(size[:-2], size[2:])
    change[1:-1][size[1:-1] > JUMP * beside + 1.0] = 0.0
    return change
