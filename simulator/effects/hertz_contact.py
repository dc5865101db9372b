"""Non-linear contact: k d^n."""

import math

from simulator.effects.law import Effect


class HertzContact(Effect):
    """Spring with a free exponent; 1.5 for a sphere on a plane."""

    identifier = "hertz_contact"
    defaults = {"exponent": 1.03}
    positive = ("exponent",)

    def __init__(self, exponent: float) -> None:
        self._n = exponent

    def spring_force(self, d: float, stiffness: float, force: float) -> float:  # noqa: ARG002
        # Odd beyond d = 0, where only a step that looks for the loss of contact gets to.
        return math.copysign(stiffness * abs(d) ** self._n, d)
