"""Restoring force: -k_r x on the part."""

from simulator.effects.law import Effect


class RestoringForce(Effect):
    """A cable or spring that pulls the part to x = 0."""

    identifier = "restoring_force"
    defaults = {"stiffness_n_per_m": 300.0}

    def __init__(self, stiffness_n_per_m: float) -> None:
        self._stiffness = stiffness_n_per_m

    def body_force(self, x: float, v: float, t: float) -> float:  # noqa: ARG002
        return -self._stiffness * x
