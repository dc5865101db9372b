"""Captures of taps made by the simulator's own plant: the independent truth of the tests of prediction."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from impactcell.records import Capture, Channel
from simulator import plant as simulated

VISCOUS: dict[str, Any] = {"viscous_friction": {"viscous_coefficient_n_s_per_m": 85.0}}
_motions: dict[str, simulated.Motion] = {}
"""Of the taps that were asked for, by what tells them apart."""


@dataclass(frozen=True, slots=True)
class Tap:
    """One tap of the reference plant, or of one that differs from it."""

    velocity_m_s: float = 0.06
    mu_s: float = 0.2
    ratio: float = 0.76
    mass_kg: float = 18.9
    stroke_m: float = math.inf
    direction: int = 1
    start_m: float = 0.0
    stiffness: float = 6.5e5
    damping: float = 465.0
    effects: dict[str, Any] = field(default_factory=lambda: dict(VISCOUS))

    @property
    def mu_k(self) -> float:
        return self.ratio * self.mu_s

    def motion(self) -> simulated.Motion:
        """Integrate the tap, once in a process: many tests make the same ones."""
        key = repr(self)
        if key not in _motions:
            _motions[key] = self._integrated()
        return _motions[key]

    def _integrated(self) -> simulated.Motion:
        plant = simulated.Plant(self.stiffness, self.damping, self.mu_s, self.mu_k, effects=self.effects)
        strike = simulated.TapInput(
            self.velocity_m_s,
            self.mass_kg,
            self.stroke_m,
            self.direction,
            math.isinf(self.stroke_m),
            self.start_m,
        )
        return simulated.simulate_tap(plant, strike)

    def capture(
        self,
        rng: np.random.Generator | None = None,
        force_hz: float = 1e4,
        position_hz: float = 1e4,
        force_std_n: float = 0.4,
        position_std_m: float = 1.5e-6,
        from_table_zero: bool = True,
        cycle: int = 1,
    ) -> Capture:
        """Sample the tap; without `rng` there is no noise, but the sensors' noise is stated all the same."""
        moved = self.motion()
        times = np.arange(1, round((moved.separation_s + 3e-3) * force_hz)) / force_hz
        position_times = np.arange(1, round((moved.stop_s + 2e-2) * position_hz)) / position_hz
        force, position = moved.force_n(times), moved.position_m(position_times)
        if from_table_zero:
            position = position + self.start_m
        if rng is not None:
            force = force + rng.normal(0.0, force_std_n, len(force))
            position = position + rng.normal(0.0, position_std_m, len(position))
        return Capture(
            cycle=cycle,
            velocity_m_s=self.velocity_m_s,
            mass_kg=self.mass_kg,
            force=Channel(times, force, force_std_n),
            position=Channel(position_times, position, position_std_m),
            direction=self.direction,
            stroke_m=self.stroke_m,
            start_m=self.start_m,
        )
