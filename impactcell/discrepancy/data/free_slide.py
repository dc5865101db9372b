"""Free slides: the part moves already when the record begins, and friction alone stops it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.data.excitation import ExcitationStrategy
from impactcell.discrepancy.data.phases import FREE_SLIDE, STOP, Trajectory
from impactcell.discrepancy.data.plant_guesses import friction_of_slides
from impactcell.discrepancy.data.prepared_shots import POSITION, IndexArray, PreparedShot, ShotSet
from impactcell.discrepancy.data.unit_checks import PlausibleRatio
from impactcell.records import Capture, Channel

DECELERATION_RATIO = PlausibleRatio(
    1e-4, 20.0, "the deceleration over gravity", "position_m or time_s", far=50.0
)
"""Free of contact, friction decelerates at a fraction of g."""
MIN_SAMPLES = 8
"""Samples of a slide from which on its curvature means anything."""


class FreeSlide(ExcitationStrategy):
    """No contact in the record; the initial speed is unknown and fitted."""

    excitation = Excitation.FREE_SLIDE
    free_plant_parameters = ("mu_k",)
    mass_is_visible = False
    guess_shares = (1.0, 0.3)

    def predicted_channels(self, capture: Capture) -> tuple[Channel | None, Channel | None, Channel | None]:
        """Return the position."""
        return None, capture.position, None

    def missing_information(self, shots: Sequence[PreparedShot]) -> list[str]:
        """Masses that are not stated, and what takes their place."""
        unstated = sum(math.isnan(shot.mass_kg) for shot in shots)
        if not unstated:
            return []
        said = f"The mass of {unstated} of {len(shots)} slides is not stated, and a slide does not show it: "
        if unstated < len(shots):
            return [said + "the median of the others is taken."]
        return [said + "forces, as of viscous friction, are told for a part of 1 kg; state mass_kg."]

    def with_unstated_masses(self, shots: list[PreparedShot]) -> list[PreparedShot]:
        """Give slides that state no mass the median of the others; 1 kg where none does."""
        masses = self.initial_mass(shots)
        return [replace(shot, mass_kg=float(mass)) for shot, mass in zip(shots, masses, strict=True)]

    def unit_ratios(self, shot: PreparedShot, gravity_m_s2: float) -> Mapping[PlausibleRatio, float]:
        """Deceleration over gravity."""
        time, position = shot.times[POSITION], shot.values[POSITION]
        if len(time) < MIN_SAMPLES:
            return {}
        curvature = np.polyfit(time, position, 2)[0]
        return {DECELERATION_RATIO: abs(2.0 * curvature) / gravity_m_s2}

    def plant_guesses(self, shots: Sequence[PreparedShot], gravity_m_s2: float) -> list[dict[str, float]]:
        """Friction by the curvature of the slides."""
        return [{"mu_k": friction_of_slides(shots, gravity_m_s2)}]

    def sample_phases(self, shots: ShotSet, trajectory: Trajectory) -> IndexArray:
        """Free slide, and stop after it."""
        phase = np.full(shots.values.size, STOP, dtype=np.int64)
        phase[np.abs(trajectory.speed_m_s) > 0.0] = FREE_SLIDE
        return phase
