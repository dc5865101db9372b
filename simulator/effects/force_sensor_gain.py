"""Gain error of the force sensor: F (1 + e)."""

from simulator.effects.law import Effect


class ForceSensorGain(Effect):
    """The force channel is out of calibration."""

    identifier = "force_sensor_gain"
    defaults = {"relative_error": 0.03}

    def __init__(self, relative_error: float) -> None:
        self._error = relative_error

    def sensed(self, force: float) -> float:
        return force * (1.0 + self._error)
