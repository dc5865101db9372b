"""What lies ahead for parts of one mass: the taps there are, and what is still to do at each distance."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from impactcell.positioning.displacement_quantiles import (
    COARSE_Z,
    parameter_scenarios,
    plant_parameters,
    quantile_table,
)
from impactcell.positioning.dynamic_programming import ValueFunction, solve_value_function
from impactcell.positioning.planner_posterior import PlannerPosterior, anticipate_learning
from impactcell.positioning.safety_limits import allowed_strokes
from impactcell.records import Samples

SLOWEST_M_S = 0.005
VELOCITIES = 24
STROKES = 60
MULTIPLIER = 0.15  # Lagrange multiplier of the bound on overshoot, times that bound
SAME_MASS = 0.03
STALE = np.array([0.02, 0.04, 0.08, 0.03, 2.0])  # change of the belief after which an outlook is made anew


@dataclass(frozen=True, slots=True)
class PlannerLimits:
    """What a planner may do; see `TapPlanner`."""

    tolerance_m: float
    max_velocity_m_s: float
    max_stroke_m: float
    max_force_n: float
    overshoot_probability: float

    def penalty(self, caution: float) -> float:
        """Taps that an overshoot may cost."""
        return MULTIPLIER * caution / self.overshoot_probability

    @property
    def velocities(self) -> Samples:
        """Velocities of the table; denser where there is no stroke to choose."""
        count = VELOCITIES * (8 if math.isinf(self.max_stroke_m) else 1)
        return np.geomspace(min(SLOWEST_M_S, 0.5 * self.max_velocity_m_s), self.max_velocity_m_s, count)

    @property
    def strokes(self) -> Samples:
        """Strokes of the table, finer where the part only just moves."""
        if math.isinf(self.max_stroke_m):
            return np.array([math.inf])
        knee = 0.2 * self.max_stroke_m
        fine = np.linspace(knee / STROKES, knee, STROKES // 2, endpoint=False)
        return np.concatenate([fine, np.linspace(knee, self.max_stroke_m, STROKES // 2)])

    def caps(self, belief: PlannerPosterior, part: Samples) -> Samples:
        """Longest stroke at each velocity that the limit of force allows."""
        if math.isinf(self.max_force_n):
            return np.full(self.velocities.size, math.inf)
        return allowed_strokes(self.velocities, self.max_force_n, stiffest(belief), part[0], part[1])


class LookaheadTable(NamedTuple):
    """Taps and cost to go for parts of one mass, and the belief they were worked out from."""

    part: Samples
    caution: float
    belief: PlannerPosterior
    table: Samples
    value: ValueFunction

    @property
    def furthest_m(self) -> float:
        """Largest median displacement; 0 where nothing moves the part."""
        return float(np.nanmax(self.table[:, :, COARSE_Z.size // 2], initial=0.0))

    def serves(self, part: Samples, caution: float, belief: PlannerPosterior) -> bool:
        """Whether it need not be made anew for this part and belief."""
        if caution != self.caution or part.size != self.part.size:
            return False
        if abs(part[0] / self.part[0] - 1.0) > SAME_MASS or not np.allclose(part[1:], self.part[1:], 0.02):
            return False
        now, then = np.sqrt(np.diag(belief.cov)), np.sqrt(np.diag(self.belief.cov))
        if not 0.9 < belief.scatter / self.belief.scatter < 1.1:
            return False
        return bool(
            (np.abs(belief.mean - self.belief.mean) < STALE).all() and (np.abs(now - then) < STALE).all()
        )


def stiffest(belief: PlannerPosterior) -> Samples:
    """Plant (k, b, mu_s, mu_k, k_v) that presses hardest, within three standard deviations."""
    worst = belief.mean + 3.0 * np.sqrt(np.diag(belief.cov))
    plant: Samples = plant_parameters(worst[None])[0] * np.array([1.0, 1.0, 1.1, 1.1, 1.0])
    return plant


def build_lookahead(
    bounds: PlannerLimits, belief: PlannerPosterior, part: Samples, caution: float
) -> LookaheadTable:
    """Work out taps and cost to go; `part` as in `response.displacements`."""
    table = _table(bounds, belief, part)
    value = ValueFunction(1.0, np.ones(1), np.ones(1))
    if np.nanmax(table[:, :, COARSE_Z.size // 2], initial=0.0) > 0.0:
        later = anticipate_learning(belief)
        will_learn = (np.diag(belief.cov) > 1.2 * np.diag(later.cov)).any()
        ahead = _table(bounds, later, part) if will_learn else table
        if math.isinf(bounds.max_stroke_m):
            ahead = np.ascontiguousarray(ahead.swapaxes(0, 1))  # neighbours are velocities, not strokes
        value = solve_value_function(ahead, COARSE_Z, bounds.tolerance_m, bounds.penalty(caution))
    return LookaheadTable(part, caution, belief, table, value)


def _table(bounds: PlannerLimits, belief: PlannerPosterior, part: Samples) -> Samples:
    velocities, strokes = bounds.velocities, bounds.strokes
    table = quantile_table(velocities, strokes, parameter_scenarios(belief, COARSE_Z), COARSE_Z, part)
    table[strokes > bounds.caps(belief, part)[:, None]] = math.nan
    return table
