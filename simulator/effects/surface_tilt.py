"""Tilt of the surface: -m g sin(a), a > 0 uphill along +1."""

import math

from simulator.effects.law import Effect


class SurfaceTilt(Effect):
    """Weight along the surface; the normal force stays m g, as the law is written."""

    identifier = "surface_tilt"
    defaults = {"tilt_rad": 0.004}

    def __init__(self, tilt_rad: float) -> None:
        self._slope = math.sin(tilt_rad)

    def weight_fraction(self) -> float:
        return -self._slope
