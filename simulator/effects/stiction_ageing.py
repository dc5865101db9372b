"""Ageing of stiction: mu_s (1 + b log10 dwell_s), dwell at least 0.1 s."""

import math

from simulator.effects.law import Effect, Shot


class StictionAgeing(Effect):
    """Static friction grows with the logarithm of the time at rest."""

    identifier = "stiction_ageing"
    defaults = {"increase_per_decade": 0.06}

    def __init__(self, increase_per_decade: float) -> None:
        self._increase = increase_per_decade

    def static_factor(self, shot: Shot) -> float:
        if math.isnan(shot.dwell_s):
            return 1.0
        return 1.0 + self._increase * math.log10(max(shot.dwell_s, 0.1))
