"""Quadratic drag: -c x' abs(x')."""

from simulator.effects.law import Effect


class QuadraticDrag(Effect):
    """Force proportional to the square of speed."""

    identifier = "quadratic_drag"
    defaults = {"drag_coefficient_n_s2_per_m2": 250.0}

    def __init__(self, drag_coefficient_n_s2_per_m2: float) -> None:
        self._c = drag_coefficient_n_s2_per_m2

    def body_force(self, x: float, v: float, t: float) -> float:  # noqa: ARG002
        return -self._c * v * abs(v)
