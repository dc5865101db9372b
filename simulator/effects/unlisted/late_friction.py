"""Friction that rises after a time: mu (1 + a (1 - exp(-(t - t_0)/tau))) for t > t_0."""

import math

from simulator.effects.law import Effect


class LateFriction(Effect):
    """A film that breaks down some time after first contact."""

    identifier = "late_friction"
    defaults = {"amplitude": 0.35, "start_s": 0.035, "time_constant_s": 0.010}
    positive = ("time_constant_s",)

    def __init__(self, amplitude: float, start_s: float, time_constant_s: float) -> None:
        self._amplitude = amplitude
        self._start = start_s
        self._tau = time_constant_s

    def friction_factor(self, x: float, t: float) -> float:  # noqa: ARG002
        late = t - self._start
        return 1.0 - self._amplitude * math.expm1(-late / self._tau) if late > 0.0 else 1.0

    def kinks(self) -> tuple[float, ...]:
        return (self._start,)
