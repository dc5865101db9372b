"""A smooth law of which nobody knows the form: F = A sum_k c_k cos(k pi u + phase_k), k = 1 to 4, c_k ~ 1/k.

u is the position, the speed or the indentation over what a tap goes through; which of them, and coefficients
and phases, are drawn by `pattern`. What no model of a real machine gets right is of this kind.
"""

import math

import numpy as np

from simulator.effects.law import Effect

SPANS = {"position": 0.008, "speed": 0.1, "indentation": 2.5e-4}
"""Position [m], speed [m/s] and indentation [m] that taps go through at 6000 mm/min, about."""
WAVES = 4
"""Half waves over the span: smooth, and of no form that a library has."""


class WanderingForce(Effect):
    """A force that wanders smoothly with one coordinate of the motion."""

    identifier = "wandering_force"
    defaults = {"force_n": 2.0, "pattern": 1.0}
    positive = ("pattern",)

    def __init__(self, force_n: float, pattern: float) -> None:
        rng = np.random.default_rng(round(1e6 * pattern))
        self._coordinate = str(rng.choice(sorted(SPANS)))
        numbers = np.arange(1, WAVES + 1)
        sizes = rng.standard_normal(WAVES) / numbers
        sizes *= force_n * math.sqrt(2.0) / float(np.linalg.norm(sizes))
        rates = math.pi * numbers / SPANS[self._coordinate]
        phases = rng.uniform(0.0, 2.0 * math.pi, WAVES)
        self._waves = tuple(zip(sizes.tolist(), rates.tolist(), phases.tolist(), strict=True))

    def _force(self, coordinate: float) -> float:
        return math.fsum(size * math.cos(rate * coordinate + phase) for size, rate, phase in self._waves)

    def body_force(self, x: float, v: float, t: float) -> float:  # noqa: ARG002
        if self._coordinate == "position":
            return self._force(x)
        if self._coordinate == "speed" and v != 0.0:
            return self._force(abs(v))
        return 0.0

    def contact_force(self, d: float, d_rate: float, t: float) -> float:  # noqa: ARG002
        return self._force(d) if self._coordinate == "indentation" else 0.0
