"""Viscous friction: -k_v x'."""

from simulator.effects.law import Effect


class ViscousFriction(Effect):
    """Force proportional to speed."""

    identifier = "viscous_friction"
    defaults = {"viscous_coefficient_n_s_per_m": 60.0}

    def __init__(self, viscous_coefficient_n_s_per_m: float) -> None:
        self._k_v = viscous_coefficient_n_s_per_m

    def body_force(self, x: float, v: float, t: float) -> float:  # noqa: ARG002
        return -self._k_v * v
