"""Error of the stated mass: m (1 + e)."""

from simulator.effects.law import Effect


class MassError(Effect):
    """The part is heavier than the campaign says."""

    identifier = "mass_error"
    defaults = {"relative_error": 0.03}

    def __init__(self, relative_error: float) -> None:
        self._error = relative_error

    def mass(self, mass_kg: float) -> float:
        return mass_kg * (1.0 + self._error)
