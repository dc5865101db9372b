"""The tap of least expected cost, first among the table's, then refined in its stroke or velocity."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from impactcell.numerics.jit import compiled
from impactcell.numerics.raster import Raster
from impactcell.positioning.displacement_quantiles import Scenarios, displacement_quantiles
from impactcell.positioning.dynamic_programming import (
    AIMS,
    Goal,
    ValueFunction,
    expected_cost,
)
from impactcell.positioning.quadrature import Quadrature, coarse_nodes, fine_nodes
from impactcell.records import Samples

KEPT = 5  # taps of the table that are refined
FINE = 11  # strokes tried between the neighbours of one of them, and again between the best two
Allowed = Callable[[float, Samples], NDArray[np.bool_]]
"""Which strokes (m) at a velocity (m/s) may be commanded."""


class ActionSpace(NamedTuple):
    """Velocities and strokes of the table, and the longest stroke allowed at each velocity; SI.

    Between those of the table there are those of the rasters.
    """

    velocities: Samples
    strokes: Samples
    longest_strokes: Samples
    velocity_raster: Raster
    stroke_raster: Raster


class SelectedAction(NamedTuple):
    """A tap with what is expected of it; `mean` is that of its displacement, m."""

    velocity_m_s: float
    stroke_m: float
    cost: float
    overshoot: float
    mean: float


@compiled
def best_stroke(
    row: Samples, remaining: float, nodes: Quadrature, goal: Goal, value: ValueFunction, aims: Samples,
    bound: float,
) -> tuple[float, float]:  # fmt: skip
    """Cost of the best tap at one velocity and its position on the stroke axis (fractional index).

    Parameters
    ----------
    row : ndarray, shape (strokes, q)
        Displacements (m) at the nodes.
    bound : float
        Costs above it do not matter.
    """
    middle = nodes.z.size // 2
    moved = np.empty(nodes.z.size)
    best, place = math.inf, 0.0
    for j in range(row.shape[0]):
        centre = row[j, middle]
        if centre <= 0.0 or math.isnan(row[j].sum()):
            continue
        if centre <= remaining + 2.0 * goal.tolerance:
            c, _ = expected_cost(remaining, row[j], nodes, goal, value, value.cost.size, bound)
            if c < best:
                best, place, bound = c, float(j), min(bound, c)
        if j + 1 == row.shape[0]:
            continue
        following = row[j + 1, middle]
        low, high = min(centre, following), max(centre, following)
        if math.isnan(row[j + 1].sum()) or low <= 0.0 or low == high:
            continue
        if low > remaining or high < remaining - 3.0 * goal.tolerance:
            continue
        for aim in aims:
            median = remaining - aim * goal.tolerance
            if not low < median < high:
                continue
            part = (median - centre) / (following - centre)
            for q in range(moved.size):
                moved[q] = row[j, q] + part * (row[j + 1, q] - row[j, q])
            c, _ = expected_cost(remaining, moved, nodes, goal, value, value.cost.size, bound)
            if c < best:
                best, place, bound = c, j + part, min(bound, c)
    return best, place


@compiled
def shortlist(
    table: Samples, remaining: float, nodes: Quadrature, goal: Goal, value: ValueFunction, aims: Samples,
    kept: int,
) -> tuple[Samples, Samples, Samples]:  # fmt: skip
    """Velocity index, position on the stroke axis (fractional index) and cost of the best taps.

    At most one tap a velocity is kept, so that what is refined is not one tap `kept` times.
    """
    places, costs, velocities = np.zeros(kept), np.full(kept, math.inf), np.zeros(kept)
    for i in range(table.shape[0]):
        best, place = best_stroke(table[i], remaining, nodes, goal, value, aims, costs[kept - 1])
        if best < costs[kept - 1]:
            n = kept - 1
            while n > 0 and costs[n - 1] > best:
                costs[n], places[n], velocities[n] = costs[n - 1], places[n - 1], velocities[n - 1]
                n -= 1
            costs[n], places[n], velocities[n] = best, place, float(i)
    return velocities, places, costs


@compiled
def evaluate_actions(
    velocity: float, strokes: Samples, scenarios: Scenarios, remaining: float, nodes: Quadrature, goal: Goal,
    value: ValueFunction,
) -> tuple[Samples, Samples, Samples]:  # fmt: skip
    """Evaluate strokes at one velocity by the model itself: cost, overshoot and displacement (m) expected."""
    moved = np.empty((strokes.size, nodes.z.size))
    displacement_quantiles(velocity, strokes, scenarios, nodes.z, moved)
    costs, risks = np.empty(strokes.size), np.empty(strokes.size)
    for j in range(strokes.size):
        if math.isnan(moved[j].sum()):
            costs[j], risks[j] = math.inf, 1.0
        else:
            costs[j], risks[j] = expected_cost(
                remaining, moved[j], nodes, goal, value, value.cost.size, math.inf
            )
    return costs, risks, 0.5 * (moved[:, 1:] + moved[:, :-1]) @ nodes.probability


def select_action(
    remaining: float, table: Samples, value: ValueFunction, space: ActionSpace, scenarios: Scenarios,
    goal: Goal, bound: float, allowed: Allowed | None = None,
) -> tuple[SelectedAction | None, float]:  # fmt: skip
    """Tap of least cost with an overshoot probability within `bound`, and the least probability met.

    The tap is None where none is within the bound. `table` and `value` as in `LookaheadTable`; what is not
    `allowed` counts as an overshoot.
    """
    best: SelectedAction | None = None
    least = 1.0
    shortlisted = shortlist(table, remaining, coarse_nodes(), goal, value, AIMS, KEPT)
    for i, place, first in zip(*shortlisted, strict=True):
        if first == math.inf or (best is not None and first > best.cost + 1.0):
            continue
        for velocity, strokes in _neighbours(int(i), float(place), space):
            fine = strokes
            for _ in range(2):
                costs, risks, means = evaluate_actions(
                    velocity, fine, scenarios, remaining, fine_nodes(), goal, value
                )
                if allowed is not None:
                    risks = np.where(allowed(velocity, fine), risks, 1.0)
                least = min(least, float(risks.min()))
                costs = np.where(risks <= bound, costs, np.inf)
                n = int(costs.argmin())
                if costs[n] < (best.cost if best is not None else math.inf):
                    best = SelectedAction(
                        float(velocity), float(fine[n]), float(costs[n]), float(risks[n]), float(means[n])
                    )
                if fine.size < 3 or costs[n] == math.inf:
                    break
                between = np.linspace(fine[max(n - 1, 0)], fine[min(n + 1, fine.size - 1)], FINE)
                fine = space.stroke_raster.at_most(between)
    return best, least


def _neighbours(i: int, place: float, space: ActionSpace) -> list[tuple[float, Samples]]:
    """Where to look more closely: strokes about `place`, or velocities where there is no stroke to choose."""
    velocities, strokes, longest = space.velocities, space.strokes, space.longest_strokes
    if strokes.size == 1:
        above = min(i + 1, velocities.size - 1)
        high = velocities[above] if longest[above] >= strokes[0] else velocities[i]
        between = np.linspace(velocities[max(i - 1, 0)], high, 2 * FINE + 1)
        return [(float(v), strokes) for v in space.velocity_raster.at_most(between)]
    low = min(strokes[max(math.ceil(place) - 1, 0)], longest[i])
    high = strokes[min(math.floor(place) + 1, strokes.size - 1)]
    between = np.linspace(low, min(high, longest[i]), FINE)
    return [(float(velocities[i]), space.stroke_raster.at_most(between))]
