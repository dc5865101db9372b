"""Presliding: elastic stick of stiffness s0 up to mu_s m g; after a stop it re-anchors without force."""

from simulator.effects.law import Effect


class PreslidingCompliance(Effect):
    """Asperities bend before the part slides."""

    identifier = "presliding_compliance"
    defaults = {"stiffness_n_per_m": 3.0e6}

    def __init__(self, stiffness_n_per_m: float) -> None:
        self._stiffness = stiffness_n_per_m

    def presliding_stiffness(self) -> float:
        return self._stiffness
