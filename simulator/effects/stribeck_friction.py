"""Stribeck friction: mu_k + dmu exp(-(x'/v_s)²)."""

import math

from simulator.effects.law import Effect


class StribeckFriction(Effect):
    """Kinetic friction that rises towards standstill."""

    identifier = "stribeck_friction"
    defaults = {"friction_increase": 0.03, "stribeck_velocity_m_s": 0.04}
    positive = ("stribeck_velocity_m_s",)

    def __init__(self, friction_increase: float, stribeck_velocity_m_s: float) -> None:
        self._increase = friction_increase
        self._velocity = stribeck_velocity_m_s

    def kinetic_increase(self, speed: float) -> float:
        return self._increase * math.exp(-((speed / self._velocity) ** 2))
