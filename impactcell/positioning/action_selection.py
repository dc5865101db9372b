"""The tap of least expected cost, first among the table's, then refined in its stroke or velocity."""

import math
from typing import NamedTuple

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.positioning.displacement_quantiles import COARSE_Z, Z, displacement_quantiles
from impactcell.positioning.dynamic_programming import ValueFunction, expected_cost, interval_probabilities
from impactcell.records import Samples

KEPT = 5  # taps of the table that are refined
FINE = 11  # strokes tried between the neighbours of one of them, and again between the best two


class SelectedAction(NamedTuple):
    """A tap with what is expected of it."""

    velocity_m_s: float
    stroke_m: float
    cost: float
    overshoot: float


@compiled
def shortlist(
    table: Samples, remaining: float, z: Samples, mass: Samples, tolerance: float, penalty: float,
    step: float, cost: Samples, overshoot: Samples, aims: Samples, kept: int,
) -> tuple[Samples, Samples, Samples]:  # fmt: skip
    """Velocity index, position on the stroke axis (fractional index) and cost of the best taps.

    At most one tap a velocity is kept, so that what is refined is not one tap `kept` times.
    """
    nodes = z.size
    middle = nodes // 2
    where, what, which = np.zeros(kept), np.full(kept, math.inf), np.zeros(kept)
    row = np.empty(nodes)
    strokes = table.shape[1]
    for i in range(table.shape[0]):
        best, place = math.inf, 0.0
        bound = what[kept - 1]
        for j in range(strokes):
            centre = table[i, j, middle]
            if centre <= 0.0 or math.isnan(table[i, j].sum()):
                continue
            if centre <= remaining + 2.0 * tolerance:
                c, _ = expected_cost(
                    remaining, table[i, j], z, mass, tolerance, penalty, step, cost, overshoot,
                    cost.size, bound,
                )  # fmt: skip
                if c < best:
                    best, place, bound = c, float(j), min(bound, c)
            if j + 1 < strokes:
                following = table[i, j + 1, middle]
                low, high = min(centre, following), max(centre, following)
                if math.isnan(table[i, j + 1].sum()) or low <= 0.0 or low == high:
                    continue
                if low > remaining or high < remaining - 3.0 * tolerance:
                    continue
                for aim in aims:
                    wanted = remaining - aim * tolerance
                    if not low < wanted < high:
                        continue
                    part = (wanted - centre) / (following - centre)
                    for q in range(nodes):
                        row[q] = table[i, j, q] + part * (table[i, j + 1, q] - table[i, j, q])
                    c, _ = expected_cost(
                        remaining, row, z, mass, tolerance, penalty, step, cost, overshoot, cost.size, bound
                    )  # fmt: skip
                    if c < best:
                        best, place, bound = c, j + part, min(bound, c)
        if best < what[kept - 1]:
            n = kept - 1
            while n > 0 and what[n - 1] > best:
                what[n], where[n], which[n] = what[n - 1], where[n - 1], which[n - 1]
                n -= 1
            what[n], where[n], which[n] = best, place, float(i)
    return which, where, what


@compiled
def evaluate_actions(
    velocity: float, strokes: Samples, rows: Samples, z: Samples, mass: Samples, part: Samples,
    remaining: float, tolerance: float, penalty: float,
    step: float, cost: Samples, overshoot: Samples,
) -> tuple[Samples, Samples]:  # fmt: skip
    """Weigh each stroke at one velocity by the model itself: expected cost and overshoot probability."""
    moved = np.empty((strokes.size, z.size))
    displacement_quantiles(velocity, strokes, rows, z, part, moved)
    costs, risks = np.empty(strokes.size), np.empty(strokes.size)
    for j in range(strokes.size):
        if math.isnan(moved[j].sum()):
            costs[j], risks[j] = math.inf, 1.0
        else:
            costs[j], risks[j] = expected_cost(
                remaining, moved[j], z, mass, tolerance, penalty, step, cost, overshoot, cost.size, math.inf
            )  # fmt: skip
    return costs, risks


def select_action(
    remaining: float, table: Samples, velocities: Samples, strokes: Samples, rows: Samples,
    value: ValueFunction, aims: Samples, *, tolerance: float, penalty: float, bound: float, part: Samples,
    caps: Samples,
) -> tuple[SelectedAction | None, float]:  # fmt: skip
    """Tap of least cost with an overshoot probability within `bound`, and the least probability met.

    The tap is None where none is within the bound. `caps` is the longest stroke allowed at each velocity.
    """
    coarse, mass = interval_probabilities(COARSE_Z), interval_probabilities(Z)
    which, where, what = shortlist(
        table, remaining, COARSE_Z, coarse, tolerance, penalty, *value, aims, KEPT
    )  # fmt: skip
    best: SelectedAction | None = None
    least = 1.0
    for i, place, first in zip(which, where, what, strict=True):
        if first == math.inf or (best is not None and first > best.cost + 1.0):
            continue
        for velocity, tried in _neighbours(int(i), float(place), velocities, strokes, caps):
            fine = tried
            for _ in range(2):
                costs, risks = evaluate_actions(
                    velocity, fine, rows, Z, mass, part, remaining,
                    tolerance, penalty, *value,
                )  # fmt: skip
                least = min(least, float(risks.min()))
                costs = np.where(risks <= bound, costs, np.inf)
                n = int(costs.argmin())
                if costs[n] < (best.cost if best is not None else math.inf):
                    best = SelectedAction(float(velocity), float(fine[n]), float(costs[n]), float(risks[n]))
                if fine.size < 3 or costs[n] == math.inf:
                    break
                fine = np.linspace(fine[max(n - 1, 0)], fine[min(n + 1, fine.size - 1)], FINE)
    return best, least


def _neighbours(
    i: int, place: float, velocities: Samples, strokes: Samples, caps: Samples
) -> list[tuple[float, Samples]]:
    """Where to look more closely: strokes about `place`, or velocities where there is no stroke to choose."""
    if strokes.size == 1:
        above = min(i + 1, velocities.size - 1)
        high = velocities[above] if caps[above] >= strokes[0] else velocities[i]
        return [(float(v), strokes) for v in np.linspace(velocities[max(i - 1, 0)], high, 2 * FINE + 1)]
    low = strokes[max(math.ceil(place) - 1, 0)]
    high = strokes[min(math.floor(place) + 1, strokes.size - 1)]
    return [(float(velocities[i]), np.linspace(low, min(high, caps[i]), FINE))]
