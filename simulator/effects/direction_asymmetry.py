"""Asymmetry of direction: mu (1 + a direction)."""

from simulator.effects.law import Effect, Shot


class DirectionAsymmetry(Effect):
    """Both coefficients differ between the two directions."""

    identifier = "direction_asymmetry"
    defaults = {"relative_amplitude": 0.04}

    def __init__(self, relative_amplitude: float) -> None:
        self._amplitude = relative_amplitude

    def shot_factor(self, shot: Shot) -> float:
        return 1.0 + self._amplitude * shot.direction
