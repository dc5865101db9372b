"""A patch on the table: mu (1 + a exp(-(x - x_0)²/2w²))."""

import math

from simulator.effects.law import Effect


class FrictionPatch(Effect):
    """Both coefficients differ around one place."""

    identifier = "friction_patch"
    defaults = {"amplitude": 0.25, "position_m": 0.002, "width_m": 0.0005}
    positive = ("width_m",)

    def __init__(self, amplitude: float, position_m: float, width_m: float) -> None:
        self._amplitude = amplitude
        self._position = position_m
        self._width = width_m

    def friction_factor(self, x: float, t: float) -> float:  # noqa: ARG002
        return 1.0 + self._amplitude * math.exp(-0.5 * ((x - self._position) / self._width) ** 2)
