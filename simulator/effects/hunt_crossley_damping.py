"""Hunt and Crossley's damping: c d d' beside b, on approach and departure."""

from simulator.effects.law import Effect


class HuntCrossleyDamping(Effect):
    """Damping in proportion to indentation."""

    identifier = "hunt_crossley_damping"
    defaults = {"damping_n_s_per_m2": 6.0e5}

    def __init__(self, damping_n_s_per_m2: float) -> None:
        self._c = damping_n_s_per_m2

    def contact_damping(self, d: float) -> float:
        return self._c * d
