"""One tap of the module: what it met, what it shows in the header, and what really happened. Pure."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from simulator.plant import Motion, TapInput
from simulator.process import StrikeConditions


@dataclass(frozen=True, slots=True)
class RunningTap:
    """A tap under way; `began_s` is the module's own time, `sequence` the command's number or 0."""

    strike: TapInput
    met: StrikeConditions
    motion: Motion
    began_s: float
    sequence: int

    @property
    def ends_s(self) -> float:
        """When part and actuator are at rest."""
        stop_s = self.motion.stop_s
        return self.began_s + max(stop_s if math.isfinite(stop_s) else 0.0, self.motion.halt_s)

    @property
    def position_m(self) -> float:
        """Where the part comes to rest."""
        return self.strike.start_m + self.strike.direction * self.motion.displacement_m

    def header(self, time_ns: int, batch_id: str, *, mass_stated: bool) -> dict[str, float | str]:
        """Return the registers of the capture window, in SI."""
        strike, motion = self.strike, self.motion
        return {
            "direction": strike.direction,
            "cycle_time": time_ns,
            "velocity": strike.velocity_m_s,
            "mass": strike.mass_kg if mass_stated else math.nan,
            "stroke": strike.stroke_m,
            "dwell": strike.dwell_s,
            "start_position": strike.start_m,
            "peak_force": motion.peak_force_n,
            "sliding_distance": motion.sliding_distance_m if math.isfinite(motion.separation_s) else 0.0,
            "batch_id": batch_id,
        }

    def truth(self, session: int, cycle: int, time_ns: int) -> Mapping[str, Any]:
        """Return what no sensor knows, for tests."""
        strike, motion = self.strike, self.motion
        distance = motion.sliding_distance_m
        return {
            "cycle": cycle,
            "session": session,
            "time_ns": time_ns,
            "mu_s": motion.mu_s,
            "mu_k": motion.mu_k,
            "batch": self.met.batch.id,
            "velocity_m_s": strike.velocity_m_s,
            "stroke_m": strike.stroke_m,
            "direction": strike.direction,
            "mass_kg": strike.mass_kg,
            "peak_force_n": motion.peak_force_n,
            "sliding_distance_m": None if math.isnan(distance) else distance,
            "displacement_m": motion.displacement_m,
            "position_m": self.position_m,
            "deviation": self.met.deviation,
            "effects": list(self.met.plant.effects),
        }
