"""Phases of a shot, and the motion by which samples are told to belong to them."""

from dataclasses import dataclass

from impactcell.records import Samples

PHASES = ("preload", "loading", "unloading", "free_slide", "stop", "driven")
"""Names of the phases of a sample, by their numbers."""
# Preload lasts from contact to breakaway; loading while the contact is being compressed, unloading while it
# relaxes; free slide from there to rest. What the actuator does to a part that has stopped is `stop`.
PRELOAD, LOADING, UNLOADING, FREE_SLIDE, STOP, DRIVEN = range(6)
BETWEEN_SHOTS = "between_shots"
"""Where effects show that act on a shot's friction factor as a whole."""


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """State of the part and of the actuator at every sample, shape (N,) each, along the shot."""

    part_displacement_m: Samples
    speed_m_s: Samples
    actuator_displacement_m: Samples
