"""What an effect may act on: one method for each place, all of them without effect until overridden.

Coordinates: x is the position on the table along +1, v its rate; d is the indentation, positive in
contact, and `-d` the gap. Forces on the part are along +1; the contact force is positive in compression.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

Parameter = float | Sequence[float]


@dataclass(frozen=True, slots=True)
class Shot:
    """What an effect may know of the shot.

    Attributes
    ----------
    direction : int
        +1 or -1.
    start_m : float
        Table position at which the part lies.
    dwell_s : float
        Time at rest before the shot; nan where it is not known.
    number, shots : int
        Place in the campaign counted from 1, and how many shots it has.
    batch : int
        0 for the first batch seen, 1 for the second, ...
    """

    direction: int = 1
    start_m: float = 0.0
    dwell_s: float = float("nan")
    number: int = 1
    shots: int = 1
    batch: int = 0


class Effect:
    """One named departure from the nominal plant.

    Attributes
    ----------
    identifier : str
        Name in scenarios, the same as in results of the discrepancy workflow.
    defaults : mapping
        A strength that shows clearly in a campaign of 60 shots.
    absolute_tolerance : tuple of float
        One entry for each state of its own, with its integration tolerance; empty for a law without memory.
    ongoing : bool
        True where something moves on although the part is at rest.
    positive : tuple of str
        Parameters that have to be above 0 for the law to mean anything.
    sensor_stage : int
        Place in the measuring chain: gain before offset before saturation.
    """

    identifier: ClassVar[str]
    defaults: ClassVar[Mapping[str, Parameter]]
    absolute_tolerance: tuple[float, ...] = ()
    ongoing: bool = False
    positive: ClassVar[tuple[str, ...]] = ()
    sensor_stage: ClassVar[int] = 0

    def mass(self, mass_kg: float) -> float:
        """Return the mass that really moves where `mass_kg` is believed."""
        return mass_kg

    def detached_mass(self) -> float:
        """Return the mass that weighs on the table but does not move with the part."""
        return 0.0

    def shot_factor(self, shot: Shot) -> float:  # noqa: ARG002
        """Return the factor of both friction coefficients for a whole shot."""
        return 1.0

    def static_factor(self, shot: Shot) -> float:  # noqa: ARG002
        """Return the factor of mu_s alone for a whole shot."""
        return 1.0

    def friction_factor(self, x: float, t: float) -> float:  # noqa: ARG002
        """Return the factor of both friction coefficients here and now."""
        return 1.0

    def kinetic_increase(self, speed: float) -> float:  # noqa: ARG002
        """Return what adds to mu_k at this speed."""
        return 0.0

    def presliding_stiffness(self) -> float:
        """Return the stiffness of elastic stick in N/m; 0 for rigid stick."""
        return 0.0

    def body_force(self, x: float, v: float, t: float) -> float:  # noqa: ARG002
        """Return a force on the part along +1."""
        return 0.0

    def weight_fraction(self) -> float:
        """Return the part of the weight that acts along +1."""
        return 0.0

    def state_force(self, x: float, v: float, own: Sequence[float]) -> float:  # noqa: ARG002
        """Return a force on the part along +1 that depends on states of the effect's own."""
        return 0.0

    def initial(self, x: float, v: float) -> tuple[float, ...]:  # noqa: ARG002
        """Return the effect's own states at first contact."""
        return (0.0,) * len(self.absolute_tolerance)

    def rates(
        self,
        x: float,  # noqa: ARG002
        v: float,  # noqa: ARG002
        d: float,  # noqa: ARG002
        force: float,  # noqa: ARG002
        own: Sequence[float],  # noqa: ARG002
    ) -> tuple[float, ...]:
        """Return the rates of the effect's own states; `force` is the contact force, d 0 without contact."""
        return ()

    def spring_force(self, d: float, stiffness: float, force: float) -> float:  # noqa: ARG002
        """Return the elastic contact force, given what it is without this effect."""
        return force

    def contact_damping(self, d: float) -> float:  # noqa: ARG002
        """Return damping in N s/m that acts on approach and on departure."""
        return 0.0

    def contact_force(self, d: float, d_rate: float, t: float) -> float:  # noqa: ARG002
        """Return a further contact force while d > 0."""
        return 0.0

    def state_contact_force(self, d: float, own: Sequence[float]) -> float:  # noqa: ARG002
        """Return a further contact force while d > 0, from states of the effect's own."""
        return 0.0

    def pull(self, gap: float) -> float:  # noqa: ARG002
        """Return the attraction between actuator and part at this gap, positive."""
        return 0.0

    def pull_range(self) -> float:
        """Return the gap from which on there is no attraction."""
        return 0.0

    def actuator_speed(self, t: float, v: float, speed: float) -> float:  # noqa: ARG002
        """Return the speed of the actuator, given what it is without this effect."""
        return speed

    def speed_loss(self, own: Sequence[float]) -> float:  # noqa: ARG002
        """Return by how much the actuator is slower, from states of the effect's own."""
        return 0.0

    def compliance(self) -> float:
        """Return the speed that the actuator loses at once for each newton, m/s/N."""
        return 0.0

    def kinks(self) -> tuple[float, ...]:
        """Return the times at which the law is not smooth, so that a step ends there."""
        return ()

    def sensed(self, force: float) -> float:
        """Return what the force sensor shows for `force`."""
        return force

    def sensor_time_constant(self) -> float:
        """Return the sensor's first-order lag; where it is positive, the first own state is what it shows."""
        return 0.0

    def position_time_constant(self) -> float:
        """Return the first-order lag of the position sensor."""
        return 0.0

    def delay(self) -> float:
        """Return by how much force is recorded late against position."""
        return 0.0
