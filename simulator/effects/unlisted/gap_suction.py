"""Suction over a wide gap: a pull of A sin²(pi gap/l) for gap < l, nothing at contact itself."""

import math

from simulator.effects.law import Effect


class GapSuction(Effect):
    """A film that is drawn out between actuator and part and then tears."""

    identifier = "gap_suction"
    defaults = {"force_n": 25.0, "range_m": 2.0e-3}
    positive = ("range_m",)

    def __init__(self, force_n: float, range_m: float) -> None:
        self._force = force_n
        self._range = range_m

    def pull(self, gap: float) -> float:
        return self._force * math.sin(math.pi * gap / self._range) ** 2

    def pull_range(self) -> float:
        return self._range
