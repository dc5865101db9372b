"""Adhesion: pull -A (1 - gap/l) after separation, gap < l."""

from simulator.effects.law import Effect


class Adhesion(Effect):
    """Actuator and part attract each other over a short gap."""

    identifier = "adhesion"
    defaults = {"force_n": 15.0, "range_m": 3.0e-4}
    positive = ("range_m",)

    def __init__(self, force_n: float, range_m: float) -> None:
        self._force = force_n
        self._range = range_m

    def pull(self, gap: float) -> float:
        return self._force * (1.0 - gap / self._range)

    def pull_range(self) -> float:
        return self._range
