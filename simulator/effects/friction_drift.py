"""Drift of friction: mu (1 + c (shot/N - 1/2))."""

from simulator.effects.law import Effect, Shot


class FrictionDrift(Effect):
    """Both coefficients change steadily over the campaign."""

    identifier = "friction_drift"
    defaults = {"relative_change": 0.10}

    def __init__(self, relative_change: float) -> None:
        self._change = relative_change

    def shot_factor(self, shot: Shot) -> float:
        return 1.0 + self._change * (shot.number / shot.shots - 0.5)
