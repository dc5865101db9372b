"""What may move of what every shot has of its own, and how far."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from impactcell.discrepancy.data import ShotSet
from impactcell.discrepancy.model.shot_parameters import STD_OF_TOLD, ShotParameters
from impactcell.records import Samples

LARGEST_FACTOR_STEP, LARGEST_LOG_FACTOR = 0.7, 3.0
"""Of the logarithm of a friction factor, in one step and in all: a factor of two, and of twenty."""
LARGEST_MASS_STEP = 0.3
"""Of the logarithm of a mass in one step."""
LARGEST_TOLD_STEP, LARGEST_TOLD_ERROR = 0.05, 0.3
"""Of the logarithm of what is told of a shot, in one step and in all."""


@dataclass(frozen=True, slots=True, eq=False)
class ShotFreedom:
    """Which of the shots' own numbers a fit moves.

    Attributes
    ----------
    names : tuple of str
        In the order of a step's columns.
    unknown_mass : ndarray, shape (n,)
        Whose mass is not told.
    onset_step_s : ndarray, shape (n,)
        How far first contact may lie from t = 0.
    is_open : mapping of str to ndarray, shape (n,)
        Which shots are told a setting as it was measured, a little off.
    """

    names: tuple[str, ...]
    unknown_mass: NDArray[np.bool_]
    onset_step_s: Samples
    is_open: Mapping[str, NDArray[np.bool_]]

    @classmethod
    def of(cls, shots: ShotSet) -> "ShotFreedom":
        """Read it off a set of shots."""
        unknown_mass = np.array([not math.isfinite(shot.mass_kg) for shot in shots.items])
        unknown_mass &= shots.excitation.mass_is_visible
        onset_step_s = np.array([shot.onset_step_s for shot in shots.items])
        is_open = {
            "log_velocity": np.array([shot.velocity_is_open for shot in shots.items]),
            "log_mass": np.array([shot.mass_is_open for shot in shots.items]),
        }
        if not shots.excitation.has_contact:
            is_open = {name: np.zeros_like(those) for name, those in is_open.items()}
        names = (
            *shots.excitation.shot_parameters,
            *(("mass_kg",) if unknown_mass.any() else ()),
            *(("onset_s",) if onset_step_s.any() else ()),
            *(name for name, those in is_open.items() if those.any()),
        )
        return cls(names, unknown_mass, onset_step_s, is_open)

    def step(self, shot_parameters: ShotParameters, steps: Samples) -> ShotParameters:
        """Each shot's own numbers after steps of shape (n, q) in the order of `names`."""
        changed = {name: getattr(shot_parameters, name) for name in self.names}
        for column, name in enumerate(self.names):
            if name == "mass_kg":
                factor = np.exp(np.clip(steps[:, column], -LARGEST_MASS_STEP, LARGEST_MASS_STEP))
                changed[name] = np.where(self.unknown_mass, changed[name] * factor, changed[name])
            elif name == "log_factor":
                step = np.clip(steps[:, column], -LARGEST_FACTOR_STEP, LARGEST_FACTOR_STEP)
                changed[name] = np.clip(changed[name] + step, -LARGEST_LOG_FACTOR, LARGEST_LOG_FACTOR)
            elif name == "speed_m_s":
                changed[name] = changed[name] + steps[:, column] * (changed[name] != 0.0)
            elif name in STD_OF_TOLD:
                step = np.clip(steps[:, column], -LARGEST_TOLD_STEP, LARGEST_TOLD_STEP)
                moved = np.clip(changed[name] + step, -LARGEST_TOLD_ERROR, LARGEST_TOLD_ERROR)
                changed[name] = np.where(self.is_open[name], moved, changed[name])
            elif name == "onset_s":
                changed[name] = np.clip(
                    changed[name] + steps[:, column], -self.onset_step_s, self.onset_step_s
                )
            else:
                changed[name] = changed[name] + steps[:, column]
        return replace(shot_parameters, **changed)

    def pressed(self, shot_parameters: ShotParameters, gradient: Samples) -> NDArray[np.bool_]:
        """Which of the shots' own numbers are at an end of their range beyond which they would go, (n, q).

        Parameters
        ----------
        gradient : ndarray, shape (n, q)
            Minus that of the cost: in the direction of its fall.
        """
        pressed = np.zeros(gradient.shape, dtype=np.bool_)
        if "onset_s" in self.names:
            column, onset = self.names.index("onset_s"), shot_parameters.onset_s
            at_end = (np.abs(onset) >= self.onset_step_s) & (self.onset_step_s > 0.0)
            pressed[:, column] = at_end & (np.sign(onset) == np.sign(gradient[:, column]))
        return pressed
