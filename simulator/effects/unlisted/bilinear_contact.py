"""A second spring that is met at some indentation: + k_2 (d - d_2) for d > d_2."""

from simulator.effects.law import Effect


class BilinearContact(Effect):
    """The actuator's tip bottoms on a stiffer backing."""

    identifier = "bilinear_contact"
    defaults = {"stiffness_n_per_m": 6.0e5, "indentation_m": 2.0e-4}

    def __init__(self, stiffness_n_per_m: float, indentation_m: float) -> None:
        self._stiffness = stiffness_n_per_m
        self._indentation = indentation_m

    def contact_force(self, d: float, d_rate: float, t: float) -> float:  # noqa: ARG002
        return self._stiffness * max(d - self._indentation, 0.0)
