"""Friction along the table: mu (1 + a x)."""

from simulator.effects.law import Effect


class PositionDependentFriction(Effect):
    """Both coefficients change linearly with position."""

    identifier = "position_dependent_friction"
    defaults = {"gradient_per_m": 10.0}

    def __init__(self, gradient_per_m: float) -> None:
        self._gradient = gradient_per_m

    def friction_factor(self, x: float, t: float) -> float:  # noqa: ARG002
        return 1.0 + self._gradient * x
