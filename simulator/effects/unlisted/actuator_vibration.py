"""Vibration of the actuator: y' + a w cos(w t) while it runs."""

import math

from simulator.effects.law import Effect


class ActuatorVibration(Effect):
    """A drive with cogging or a badly tuned loop."""

    identifier = "actuator_vibration"
    defaults = {"amplitude_m": 1.2e-5, "frequency_hz": 180.0}

    def __init__(self, amplitude_m: float, frequency_hz: float) -> None:
        self._rate = 2.0 * math.pi * frequency_hz
        self._speed = amplitude_m * self._rate

    def actuator_speed(self, t: float, v: float, speed: float) -> float:  # noqa: ARG002
        return speed + self._speed * math.cos(self._rate * t)
