"""Droop of the actuator: y' = v - w, tau w' + w = c F."""

from collections.abc import Sequence

from simulator.effects.law import Effect


class ActuatorDroop(Effect):
    """The drive slows down under load, with a first-order lag."""

    identifier = "actuator_droop"
    defaults = {"speed_loss_m_per_s_n": 2.0e-5, "time_constant_s": 0.003}

    def __init__(self, speed_loss_m_per_s_n: float, time_constant_s: float) -> None:
        self._c = speed_loss_m_per_s_n
        self._tau = time_constant_s
        self.absolute_tolerance = (1e-13,) if time_constant_s > 0.0 else ()

    def rates(self, x: float, v: float, d: float, force: float, own: Sequence[float]) -> tuple[float, ...]:  # noqa: ARG002
        return ((self._c * force - own[0]) / self._tau,)

    def speed_loss(self, own: Sequence[float]) -> float:
        return own[0] if own else 0.0

    def compliance(self) -> float:
        return 0.0 if self.absolute_tolerance else self._c
