"""A magnet beside the track: A / (1 + ((x - x_0)/w)²) along +1, as of a stray field at the stroke's end."""

from simulator.effects.law import Effect


class MagneticPull(Effect):
    """A pull that is felt around one place of the table."""

    identifier = "magnetic_pull"
    defaults = {"force_n": 8.0, "position_m": 0.006, "width_m": 0.0015}
    positive = ("width_m",)

    def __init__(self, force_n: float, position_m: float, width_m: float) -> None:
        self._force = force_n
        self._position = position_m
        self._width = width_m

    def body_force(self, x: float, v: float, t: float) -> float:  # noqa: ARG002
        return self._force / (1.0 + ((x - self._position) / self._width) ** 2)
