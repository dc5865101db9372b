"""Saturation of the force channel: min(F, F_max)."""

from simulator.effects.law import Effect


class ForceSaturation(Effect):
    """The force channel ends below the peak."""

    identifier = "force_saturation"
    sensor_stage = 2
    defaults = {"limit_n": 200.0}

    def __init__(self, limit_n: float) -> None:
        self._limit = limit_n

    def sensed(self, force: float) -> float:
        return min(force, self._limit)
