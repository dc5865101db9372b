"""A loose second mass inside the part, held by a spring and a damper; the whole weight rests on the table."""

from collections.abc import Sequence

from simulator.effects.law import Effect


class LooseMass(Effect):
    """States: position and velocity of the loose mass along +1 against its place at first contact."""

    identifier = "loose_mass"
    defaults = {"mass_kg": 1.0, "stiffness_n_per_m": 2.0e5, "damping_n_s_per_m": 60.0}
    positive = ("mass_kg",)
    ongoing = True

    def __init__(self, mass_kg: float, stiffness_n_per_m: float, damping_n_s_per_m: float) -> None:
        self._mass = mass_kg
        self._stiffness = stiffness_n_per_m
        self._damping = damping_n_s_per_m
        self.absolute_tolerance = (1e-13, 1e-12)

    def detached_mass(self) -> float:
        return self._mass

    def initial(self, x: float, v: float) -> tuple[float, ...]:
        return (x, v)

    def _coupling(self, x: float, v: float, own: Sequence[float]) -> float:
        return self._stiffness * (own[0] - x) + self._damping * (own[1] - v)

    def state_force(self, x: float, v: float, own: Sequence[float]) -> float:
        return self._coupling(x, v, own)

    def rates(self, x: float, v: float, d: float, force: float, own: Sequence[float]) -> tuple[float, ...]:  # noqa: ARG002
        return own[1], -self._coupling(x, v, own) / self._mass
