"""A contact that relaxes: a spring in series with a dashpot beside k, F = k_1 (d - q), tau q' = d - q."""

from collections.abc import Sequence

from simulator.effects.law import Effect


class RelaxingContact(Effect):
    """State: the dashpot's extension q, 0 at first contact."""

    identifier = "relaxing_contact"
    defaults = {"stiffness_n_per_m": 2.0e5, "time_constant_s": 0.004}
    positive = ("time_constant_s",)

    def __init__(self, stiffness_n_per_m: float, time_constant_s: float) -> None:
        self._stiffness = stiffness_n_per_m
        self._tau = time_constant_s
        self.absolute_tolerance = (1e-13,)

    def state_contact_force(self, d: float, own: Sequence[float]) -> float:
        return self._stiffness * (d - own[0])

    def rates(self, x: float, v: float, d: float, force: float, own: Sequence[float]) -> tuple[float, ...]:  # noqa: ARG002
        return ((d - own[0]) / self._tau,)
