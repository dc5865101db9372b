"""Vibration of the machine: a force A sin(w t) on the part along +1."""

import math

from simulator.effects.law import Effect


class MachineVibration(Effect):
    """A neighbouring machine shakes the table, in step with the cycle."""

    identifier = "machine_vibration"
    defaults = {"force_n": 6.0, "frequency_hz": 70.0}

    def __init__(self, force_n: float, frequency_hz: float) -> None:
        self._force = force_n
        self._rate = 2.0 * math.pi * frequency_hz

    def body_force(self, x: float, v: float, t: float) -> float:  # noqa: ARG002
        return self._force * math.sin(self._rate * t)
