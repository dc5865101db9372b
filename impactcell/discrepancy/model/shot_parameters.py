"""What every shot of a set has of its own: friction factor, mass, initial speed, shift, contact, settings."""

from dataclasses import dataclass, fields

from impactcell.discrepancy.data import IndexArray
from impactcell.records import MASS_STD, VELOCITY_STD, Samples

STD_OF_TOLD = {"log_velocity": VELOCITY_STD, "log_mass": MASS_STD}
"""Relative standard deviation with which what is told of a shot is known, where it is open."""


@dataclass(frozen=True, slots=True, eq=False)
class ShotParameters:
    """What every shot has of its own, each of shape (n,).

    Attributes
    ----------
    log_factor : ndarray
        Logarithm of the shot's friction factor.
    mass_kg : ndarray
        As told; fitted where nothing is.
    speed_m_s : ndarray
        Initial speed; nan where an actuator strikes.
    shift_m : ndarray
        Added to the positions: error of the first sample, which a free slide counts from.
    onset_s : ndarray
        When first contact was, by the times of the samples: 0, unless it lies between two of them.
    log_velocity, log_mass : ndarray
        Logarithm of velocity and mass over what is told of them: 0, unless it is open.
    """

    log_factor: Samples
    mass_kg: Samples
    speed_m_s: Samples
    shift_m: Samples
    onset_s: Samples
    log_velocity: Samples
    log_mass: Samples

    def cost(self, spread: float) -> Samples:
        """Squared deviations, shape (n,), of the factors by their spread, of what is told by its error."""
        cost: Samples = sum((getattr(self, name) / std) ** 2 for name, std in known_std(spread).items())
        return cost

    def select(self, places: IndexArray) -> "ShotParameters":
        """Return the numbers of some of the shots."""
        return ShotParameters(*(getattr(self, item.name)[places] for item in fields(self)))

    def with_shots(self, places: IndexArray, replacement: "ShotParameters") -> "ShotParameters":
        """Return the same numbers but for those of some shots, which are taken from `replacement`."""
        values_by_name = {item.name: getattr(self, item.name).copy() for item in fields(self)}
        for name, values in values_by_name.items():
            values[places] = getattr(replacement, name)
        return ShotParameters(**values_by_name)


def known_std(spread: float) -> dict[str, float]:
    """Give the standard deviations of what is known of every shot's own numbers, by name."""
    return {"log_factor": spread, **STD_OF_TOLD}
