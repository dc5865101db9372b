"""A film of oil that gets thinner along the table: -c x' / (1 - x/L), Couette's flow in a wedge."""

from simulator.effects.law import Effect


class WedgeDrag(Effect):
    """Drag that goes with the speed and with the place at once."""

    identifier = "wedge_drag"
    defaults = {"coefficient_n_s_per_m": 150.0, "length_m": 0.05}
    positive = ("length_m",)

    def __init__(self, coefficient_n_s_per_m: float, length_m: float) -> None:
        self._coefficient = coefficient_n_s_per_m
        self._length = length_m

    def body_force(self, x: float, v: float, t: float) -> float:  # noqa: ARG002
        return -self._coefficient * v / (1.0 - x / self._length)
