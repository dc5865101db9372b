"""Lag of the force sensor: first order, tau G' + G = F, G shown in place of F."""

from collections.abc import Sequence

from simulator.effects.law import Effect


class ForceSensorLag(Effect):
    """A low pass in the force channel, at rest before first contact."""

    identifier = "force_sensor_lag"
    defaults = {"time_constant_s": 2.0e-4}

    def __init__(self, time_constant_s: float) -> None:
        self._tau = time_constant_s
        self.absolute_tolerance = (1e-9,) if time_constant_s > 0.0 else ()

    def rates(self, x: float, v: float, d: float, force: float, own: Sequence[float]) -> tuple[float, ...]:  # noqa: ARG002
        return ((force - own[0]) / self._tau,)

    def sensor_time_constant(self) -> float:
        return self._tau
