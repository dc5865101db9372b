"""Offset of the force sensor: F + F_0."""

from simulator.effects.law import Effect


class ForceSensorOffset(Effect):
    """The force channel does not read zero without force."""

    identifier = "force_sensor_offset"
    sensor_stage = 1
    defaults = {"offset_n": 1.5}

    def __init__(self, offset_n: float) -> None:
        self._offset = offset_n

    def sensed(self, force: float) -> float:
        return force + self._offset
