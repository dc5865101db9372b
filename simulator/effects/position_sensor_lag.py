"""Lag of the position sensor: first order, tau q' + q = x, q shown in place of x."""

from simulator.effects.law import Effect


class PositionSensorLag(Effect):
    """A low pass in the position channel, at rest before first contact."""

    identifier = "position_sensor_lag"
    defaults = {"time_constant_s": 1.0e-4}

    def __init__(self, time_constant_s: float) -> None:
        self._tau = time_constant_s

    def position_time_constant(self) -> float:
        return self._tau
