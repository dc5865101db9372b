"""Ripple of the table: mu (1 + a sin(2 pi x/p + phase))."""

import math

from simulator.effects.law import Effect


class PeriodicFriction(Effect):
    """Both coefficients ripple with position."""

    identifier = "periodic_friction"
    defaults = {"amplitude": 0.12, "period_m": 0.0013, "phase_rad": 0.7}
    positive = ("period_m",)

    def __init__(self, amplitude: float, period_m: float, phase_rad: float) -> None:
        self._amplitude = amplitude
        self._wave_number = 2.0 * math.pi / period_m
        self._phase = phase_rad

    def friction_factor(self, x: float, t: float) -> float:  # noqa: ARG002
        return 1.0 + self._amplitude * math.sin(self._wave_number * x + self._phase)
