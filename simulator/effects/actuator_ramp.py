"""Ramp of the actuator: y' grows linearly from 0 to v in t_r."""

from simulator.effects.law import Effect


class ActuatorRamp(Effect):
    """The drive needs time to reach its speed."""

    identifier = "actuator_ramp"
    defaults = {"ramp_time_s": 0.002}

    def __init__(self, ramp_time_s: float) -> None:
        self._time = ramp_time_s

    def actuator_speed(self, t: float, v: float, speed: float) -> float:
        # The step ends at the kink, so that the law on either side of it is smooth within a step.
        return speed - v * (1.0 - t / self._time) if t < self._time else speed

    def kinks(self) -> tuple[float, ...]:
        return (self._time,) if self._time > 0.0 else ()
