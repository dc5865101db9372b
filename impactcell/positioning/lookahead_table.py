"""What lies ahead for parts of one mass: the taps there are, and what is still to do at each distance."""

import math
from dataclasses import dataclass, field

import numpy as np

from impactcell.numerics.raster import ANY_VALUE, Raster
from impactcell.positioning.action_selection import ActionSpace
from impactcell.positioning.displacement_discrepancy import (
    DIRECTION,
    MASS_KG,
    POSITION,
    POSITION_BY_MASS,
    position_feature,
)
from impactcell.positioning.displacement_quantiles import (
    parameter_scenarios,
    plant_parameters,
    quantile_table,
)
from impactcell.positioning.dynamic_programming import Goal, ValueFunction, solve_value_function
from impactcell.positioning.model_hypotheses import swing_std
from impactcell.positioning.planner_knowledge import Knowledge, knowledge_of, near
from impactcell.positioning.planner_posterior import (
    PARAMETERS,
    PlannerPosterior,
    anticipate_learning,
    cov_at,
    mean_at,
)
from impactcell.positioning.quadrature import COARSE_Z, coarse_nodes
from impactcell.positioning.safety_limits import allowed_strokes
from impactcell.positioning.stated_limits import (
    LIMITS,
    check_limit,
    check_overshoot_probability,
    check_raster,
)
from impactcell.records import Samples

SLOWEST_M_S = 0.005  # velocity of the table that hardly moves a part
VELOCITIES = 24  # of the table; neighbours are 14 % apart
NEAR_STROKES = 26
"""Strokes of the table about the indentation of the part, where it only just moves."""
FAR_STROKES = 38
"""Strokes beyond, each longer by the same factor."""
NEAR = (0.3, 2.0)
"""Between which of its multiples a stroke is about the indentation."""
MULTIPLIER = 0.15  # Lagrange multiplier of the bound on overshoot, times that bound
SAME_MASS = 0.03  # relative difference of parts that share a table
STALE_PLACE = 0.01
"""Of a displacement or an indentation: by how much another place may differ before a table is made anew."""
LEAST_OTHER_PLACE = 1e-3
"""Less than that is the same place."""
STEEPEST = 3.0
"""Slope of the displacement over the stroke that is followed from one place to another."""
OUTLOOK_LASTS = 3.0
"""So many times as much may have been learned before what comes later is told again."""
MOST_GOALS = 12
"""For which an outlook keeps the cost to go: near an end of the travel there is one for each target."""
STILL_TO_LEARN = 0.02
"""Taps that the whole distance is worth beside what it costs: decides between taps that are otherwise alike,
and is worth less than 2e-4 of an overshoot. Half a tap settles as fast, and overshoots more often."""


@dataclass(frozen=True, slots=True)
class PlannerLimits:
    """What a planner may do; see `TapPlanner`."""

    tolerance_m: float
    max_velocity_m_s: float
    max_stroke_m: float
    max_force_n: float
    overshoot_probability: float
    velocity_raster: Raster = ANY_VALUE
    stroke_raster: Raster = ANY_VALUE

    def __post_init__(self) -> None:
        """Refuse what no cell can have."""
        for name in LIMITS:
            check_limit(name, getattr(self, name))
        check_overshoot_probability(self.overshoot_probability)
        for name, limit in (("velocity_raster", "max_velocity_m_s"), ("stroke_raster", "max_stroke_m")):
            check_raster(name, getattr(self, name), limit, getattr(self, limit))

    @property
    def commandable(self) -> tuple[float, float, float, Raster, Raster]:
        """What says which taps there are, and so what a table of them hangs on."""
        return (
            self.max_velocity_m_s, self.max_stroke_m, self.max_force_n, self.velocity_raster,
            self.stroke_raster,
        )  # fmt: skip

    def penalty(self, caution: float) -> float:
        """Taps that an overshoot may cost."""
        return MULTIPLIER * caution / self.overshoot_probability

    @property
    def velocities(self) -> Samples:
        """Velocities of the table; denser where there is no stroke to choose."""
        count = VELOCITIES * (8 if math.isinf(self.max_stroke_m) else 1)
        slowest = min(SLOWEST_M_S, 0.5 * self.max_velocity_m_s)
        return self.velocity_raster.at_most(np.geomspace(slowest, self.max_velocity_m_s, count))

    def strokes(self, indentation_m: float) -> Samples:
        """Strokes of the table, finer about the indentation of the part, where it only just moves."""
        if math.isinf(self.max_stroke_m):
            return np.array([math.inf])
        low, high = (min(multiple * indentation_m, 0.5 * self.max_stroke_m) for multiple in NEAR)
        near = np.linspace(0.5 * low, high, NEAR_STROKES, endpoint=False)
        far = np.geomspace(high, self.max_stroke_m, FAR_STROKES)
        return self.stroke_raster.at_most(np.concatenate([near, far]))

    def goal(self, caution: float) -> Goal:
        """Tolerance, and what an overshoot may cost."""
        return Goal(self.tolerance_m, self.penalty(caution))

    def longest_strokes(
        self, velocities: Samples, posterior: PlannerPosterior, part: Samples, place: Samples
    ) -> Samples:
        """Longest stroke at each velocity that the limit of force allows."""
        if math.isinf(self.max_force_n):
            return np.full(velocities.size, math.inf)
        plant = stiffest(posterior, part, place)
        return allowed_strokes(velocities, self.max_force_n, plant, part[0], part[1])

    def space(
        self, posterior: PlannerPosterior, part: Samples, place: Samples, strokes: Samples
    ) -> ActionSpace:
        """Taps to choose from."""
        velocities = self.velocities
        longest = self.longest_strokes(velocities, posterior, part, place)
        return ActionSpace(velocities, strokes, longest, self.velocity_raster, self.stroke_raster)


@dataclass(frozen=True, slots=True, eq=False)
class Outlook:
    """Cost to go at each distance; `ahead` (m) are the taps that come later, when more is known."""

    knowledge: Knowledge
    ahead: Samples
    values: dict[Goal, ValueFunction] = field(default_factory=dict)

    def value(self, limits: PlannerLimits, caution: float, remaining: float) -> ValueFunction:
        """Cost to go at this caution, for a tap that starts at this distance (m) from the target.

        It takes for granted that more will be known, and so tells little between a tap that goes most of the
        way and one that hardly moves and teaches nothing, of which there could be many: the distance left
        has a small price of its own. The rest is worked out when it is first asked for.
        """
        goal = limits.goal(caution)
        if goal not in self.values:
            if len(self.values) >= MOST_GOALS:
                del self.values[next(iter(self.values))]
            self.values[goal] = solve_value_function(self.ahead, coarse_nodes(), goal)
        value = self.values[goal]
        left = value.step_m * np.arange(value.cost.size) / remaining
        return value._replace(cost=value.cost + STILL_TO_LEARN * left)


@dataclass(frozen=True, slots=True, eq=False)
class LookaheadTable:
    """Taps for parts of one mass, what they were worked out from, and the outlook beyond them.

    `table` (m), shape (velocities, strokes, nodes), holds for `place`. `sliding` is the share of each
    displacement that slides, and `indenting` (m) what it changes by with the indentation, relative; shape
    (velocities, strokes).
    """

    part: Samples
    place: Samples
    knowledge: Knowledge
    strokes: Samples
    table: Samples
    sliding: Samples
    indenting: Samples
    outlook: Outlook

    @property
    def furthest_m(self) -> float:
        """Largest median displacement; 0 where nothing moves the part."""
        return float(np.nanmax(self.table[:, :, COARSE_Z.size // 2], initial=0.0))

    def concerns(self, part: Samples) -> bool:
        """Whether it was made for parts like this one."""
        return bool(
            part.size == self.part.size
            and abs(part[0] / self.part[0] - 1.0) <= SAME_MASS
            and np.allclose(part[1:], self.part[1:], 0.02)
        )

    def serves(self, knowledge: Knowledge, place: Samples) -> bool:
        """Whether it need not be made anew for what is known now, and for a part that lies there."""
        return near(knowledge, self.knowledge, 1.0) and abs(self._other(place)) < STALE_PLACE

    def at(self, place: Samples) -> Samples:
        """`table` for a part that lies elsewhere: the discrepancy of the position moves with it."""
        other = self._other(place)
        if abs(other) < LEAST_OTHER_PLACE:
            return self.table
        factor, further = np.exp(self.sliding * other), self.indenting * other
        moved = np.maximum(self.table * factor[:, :, None] + further[:, :, None], 0.0)
        # what moves nothing moves nothing there either: what is lifted off zero here would look like a way
        there: Samples = np.where(self.table > 0.0, moved, self.table)
        return there

    def _other(self, place: Samples) -> float:
        """Discrepancy of another place less that of the table's own, relative."""
        along, by_mass, direction = self.knowledge.mean[
            PARAMETERS + np.array([POSITION, POSITION_BY_MASS, DIRECTION])
        ]
        further = position_feature(place[0]) - position_feature(self.place[0])
        way = (along + by_mass * MASS_KG / self.part[0]) * further
        return float(way + direction * (place[1] - self.place[1]))


def stiffest(posterior: PlannerPosterior, part: Samples, place: Samples) -> Samples:
    """Plant (k, b, mu_s, mu_k, k_v) that presses hardest, within three standard deviations."""
    std = np.sqrt(np.diag(cov_at(posterior, part, place)))
    worst = mean_at(posterior, part, place) + 3.0 * std
    plant: Samples = plant_parameters(worst[None])[0] * np.array([1.0, 1.0, 1.1, 1.1, 1.0])
    return plant


def build_lookahead(
    limits: PlannerLimits,
    posterior: PlannerPosterior,
    part: Samples,
    place: Samples,
    before: LookaheadTable | None = None,
) -> LookaheadTable:
    """Work out the taps there are; `part` and `place` as in `Scenarios`, `before` the table it replaces.

    What comes later is told again only where much more is known: it has been planned with learning anyway.
    """
    indentation, knowledge = indentation_of(posterior, part, place), knowledge_of(posterior)
    strokes = limits.strokes(indentation)
    table = _quantiles(limits, strokes, posterior, part, place)
    if before is not None and near(knowledge, before.outlook.knowledge, OUTLOOK_LASTS):
        outlook = before.outlook
    else:
        later = anticipate_learning(posterior)
        will_learn = (np.diag(posterior.cov) > 1.2 * np.diag(later.cov)).any()
        ahead = _quantiles(limits, strokes, later, part, place, swing_std(posterior)) if will_learn else table
        if strokes.size == 1:
            ahead = np.ascontiguousarray(ahead.swapaxes(0, 1))  # neighbours are velocities, not strokes
        outlook = Outlook(knowledge, ahead)
    shares = _shares(strokes, indentation, table[:, :, COARSE_Z.size // 2])
    return LookaheadTable(part, place, knowledge, strokes, table, *shares, outlook)


def indentation_of(posterior: PlannerPosterior, part: Samples, place: Samples) -> float:
    """Return the static indentation delta (m) of a part that is pushed where it lies."""
    plant = plant_parameters(mean_at(posterior, part, place)[None])[0]
    return float(plant[3] * part[0] * part[1] / plant[0])


def _shares(strokes: Samples, indentation: float, middle: Samples) -> tuple[Samples, Samples]:
    """`sliding` and `indenting` of a table."""
    pushed = np.where(np.isfinite(strokes), strokes - indentation, 0.0)
    sliding = np.nan_to_num(np.clip((middle - pushed) / np.maximum(middle, 1e-9), 0.0, 1.0))
    if strokes.size == 1:
        return sliding, np.zeros_like(middle)
    slope = np.nan_to_num(np.gradient(middle, strokes, axis=1))
    return sliding, indentation * np.clip(slope, 0.0, STEEPEST)


def _quantiles(
    limits: PlannerLimits,
    strokes: Samples,
    posterior: PlannerPosterior,
    part: Samples,
    place: Samples,
    swing: float | None = None,
) -> Samples:
    velocities = limits.velocities
    scenarios = parameter_scenarios(posterior, COARSE_Z, part, place, swing)
    table = quantile_table(velocities, strokes, scenarios, COARSE_Z)
    table[strokes > limits.longest_strokes(velocities, posterior, part, place)[:, None]] = math.nan
    return table
