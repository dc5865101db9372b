"""Expected cost to go against the remaining distance, by dynamic programming.

With W(r) the expected number of taps from a remaining distance r, and D_a the displacement of tap a,

    W(r) = 0                                                   for |r| <= tolerance
    W(r) = min_a 1 + E W(r - D_a) + penalty P(D_a > r + tolerance)  beyond

(Bellman). The penalty is the Lagrange multiplier of the bound on overshoot: what one overshoot may cost
in taps. Since a part is only ever pushed towards the target, W(r) needs W at smaller r only, and one
sweep from the tolerance outwards is exact on its grid. The probability of an overshoot under the optimal
choice is swept along with it, so that the bound can be held for the whole task.
"""

import math
from typing import NamedTuple

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.positioning.quadrature import Quadrature, normal_tail
from impactcell.records import Samples

STALL_PENALTY = 60.0  # taps that a tap which moves nothing costs: it stops a task
STALL_M = 2e-7  # displacement below which a tap has moved nothing: an encoder's resolution
AIMS = np.array([-0.4, 0.0, 0.4, 0.8, 1.4, 2.2])  # short of the target, in tolerances
WORTH_TRYING = 0.7  # taps; one whose median leaves this much more to do than the best is not evaluated
DISTANCE_WORTH = 5.0
"""Taps that the whole distance is worth, where nothing but coming nearer counts."""
LEAST_TARGET_M = 1e-6
"""Least displacement that a tap is looked for: nearer to the tolerance, less than that brings a part in."""
SLOTS = 2  # taps kept for each displacement: least spread, least reach beyond
MOSTLY_STALLED = 0.9  # probability of no progress above which a tap is no way forward


class Goal(NamedTuple):
    """What is asked of a task: the tolerance (m), and the taps that an overshoot may cost."""

    tolerance: float
    penalty: float


class ValueFunction(NamedTuple):
    """W and the overshoot probability at remaining distances 0, step, 2 step, ... (m), shape (n,)."""

    step_m: float
    cost: Samples
    overshoot: Samples


class Actions(NamedTuple):
    """Taps to choose from in a sweep.

    `displacements` (m), shape (m,), are medians; `taps`, shape (m, SLOTS, q), the displacements of the taps
    kept for each at the nodes of the quadrature, nan where a slot is empty; `aims` how far short to aim.
    """

    displacements: Samples
    taps: Samples
    aims: Samples


@compiled
def interpolate_value(step: float, values: Samples, solved: int, r: float) -> float:
    """Interpolate `values`, of which `solved` are there; beyond them, the mean slope of their second half."""
    place = r / step
    n = int(place)
    if n + 1 < solved:
        return float(values[n] + (place - n) * (values[n + 1] - values[n]))
    last = solved - 1
    half = last // 2
    slope = (values[last] - values[half]) / (last - half) if last > half else 0.0
    return float(values[last] + slope * (place - last))


@compiled
def expected_cost(
    remaining: float,
    moved: Samples,
    nodes: Quadrature,
    goal: Goal,
    value: ValueFunction,
    solved: int,
    bound: float,
) -> tuple[float, float]:
    """Weigh one tap: expected cost and overshoot probability of it and all that follow it.

    Parameters
    ----------
    moved : ndarray, shape (q,)
        Displacement at the nodes; between them it is interpolated.
    solved : int
        How many points of the value function are known. A tap that leaves the part beyond them, or where it
        was, leads back to the question that is being asked.
    bound : float
        A cost above which the answer does not matter: inf is returned as soon as it is passed.
    """
    z, probability = nodes.z, nodes.probability
    tolerance, penalty = goal.tolerance, goal.penalty
    step, cost, overshoot = value.step_m, value.cost, value.overshoot
    total, risk, again = 1.0, 0.0, 0.0
    intervals = probability.size
    whole = solved == cost.size
    reached = step * (solved - 1)
    for turn in range(intervals):  # from the middle outwards: the bound is passed early
        q = intervals // 2 + (turn + 1) // 2 * (1 if turn % 2 == 0 else -1)
        a, b = remaining - moved[q], remaining - moved[q + 1]
        near, far = min(a, b), max(a, b)
        if near > tolerance:
            r = 0.5 * (a + b)
            if moved[q] <= STALL_M and moved[q + 1] <= STALL_M:
                again += probability[q]
                total += probability[q] * STALL_PENALTY
            elif whole or r <= reached:
                total += probability[q] * interpolate_value(step, cost, solved, r)
                risk += probability[q] * interpolate_value(step, overshoot, solved, min(r, reached))
            else:
                again += probability[q]
        elif far < -tolerance:
            total += probability[q] * penalty
            risk += probability[q]
        elif far > tolerance or near < -tolerance:
            # z at which the remaining distance crosses +tolerance and -tolerance, linear between nodes
            slope = (z[q + 1] - z[q]) / (b - a)
            if near < -tolerance:
                cut = z[q] + (-tolerance - a) * slope
                part = (
                    normal_tail(z[q]) - normal_tail(cut)
                    if a < b
                    else normal_tail(cut) - normal_tail(z[q + 1])
                )
                total += part * penalty
                risk += part
            if far > tolerance:
                cut = z[q] + (tolerance - a) * slope
                part = (
                    normal_tail(cut) - normal_tail(z[q + 1])
                    if a < b
                    else normal_tail(z[q]) - normal_tail(cut)
                )
                r = min(0.5 * (tolerance + far), reached)
                if r > tolerance:
                    total += part * interpolate_value(step, cost, solved, r)
                    risk += part * interpolate_value(step, overshoot, solved, r)
                else:
                    again += part
        if total > bound:
            return math.inf, 1.0
    if again > MOSTLY_STALLED:
        return math.inf, 1.0
    return total / (1.0 - again), risk / (1.0 - again)


@compiled
def taps_by_displacement(table: Samples, targets: Samples, z: Samples) -> Samples:
    """For each displacement wanted, the taps that spread least about it: shape (targets, SLOTS, nodes), m.

    Strokes between those of the table are interpolated. A slot without a tap holds nan.
    """
    nodes = z.size
    middle = nodes // 2
    best = np.full((targets.size, SLOTS, nodes), math.nan)
    score = np.full((targets.size, SLOTS), math.inf)
    row = np.empty(nodes)
    for i in range(table.shape[0]):
        for j in range(table.shape[1] - 1):
            a, b = table[i, j, middle], table[i, j + 1, middle]
            if a > 0.0 and b > 0.0 and a != b and not math.isnan(table[i, j].sum() + table[i, j + 1].sum()):
                n = np.searchsorted(targets, min(a, b))
                while n < targets.size and targets[n] <= max(a, b):
                    part = (targets[n] - a) / (b - a)
                    square, reach = 0.0, 0.0
                    for q in range(nodes):
                        row[q] = table[i, j, q] + part * (table[i, j + 1, q] - table[i, j, q])
                        if abs(z[q]) < 2.0:
                            square += (row[q] - targets[n]) ** 2
                        if abs(z[q]) < 3.5:
                            reach = max(reach, row[q] - targets[n])
                    for s in range(SLOTS):
                        value = square if s == 0 else reach
                        if value < score[n, s]:
                            score[n, s] = value
                            best[n, s] = row
                    n += 1
    for n in range(targets.size):
        if best[n, 0, 0] == best[n, 1, 0] and best[n, 0, nodes - 1] == best[n, 1, nodes - 1]:
            best[n, 1] = math.nan  # one and the same tap
    return best


@compiled
def best_action(
    r: float, actions: Actions, nodes: Quadrature, goal: Goal, value: ValueFunction, solved: int
) -> tuple[float, float]:
    """Least expected cost from the remaining distance r, and the overshoot probability of that tap."""
    displacements, taps = actions.displacements, actions.taps
    best, risk = math.inf, 1.0
    last = np.searchsorted(displacements, r + goal.tolerance)
    for backward in range(last):
        m = last - 1 - backward
        if displacements[m] < 0.2 * r and displacements[m] < 0.5 * displacements[displacements.size - 1]:
            break
        rest = r - displacements[m]
        if rest > goal.tolerance:
            least = 1.0 + interpolate_value(value.step_m, value.cost, solved, rest)
            if least > best + WORTH_TRYING:
                continue
        for s in range(SLOTS):
            if not math.isnan(taps[m, s, 0]):
                c, p = expected_cost(r, taps[m, s], nodes, goal, value, solved, best)
                if c < best:
                    best, risk = c, p
    return best, risk


@compiled
def best_aimed_action(
    r: float, actions: Actions, nodes: Quadrature, goal: Goal, value: ValueFunction, solved: int, best: float
) -> tuple[float, float]:
    """Least expected cost, below `best`, of a tap that aims just short of the target; inf where none is."""
    displacements, taps = actions.displacements, actions.taps
    row = np.empty(nodes.z.size)
    least, risk = math.inf, 1.0
    for aim in actions.aims:
        median = r - aim * goal.tolerance
        m = np.searchsorted(displacements, median)
        if median <= 0.0 or m == 0 or m >= displacements.size:
            continue
        part = (median - displacements[m - 1]) / (displacements[m] - displacements[m - 1])
        for s in range(SLOTS):
            below = taps[m - 1, s] if not math.isnan(taps[m - 1, s, 0]) else taps[m - 1, 0]
            above = taps[m, s] if not math.isnan(taps[m, s, 0]) else taps[m, 0]
            for q in range(row.size):
                row[q] = below[q] + part * (above[q] - below[q])
            if not math.isnan(row[0]):
                c, p = expected_cost(r, row, nodes, goal, value, solved, min(best, least))
                if c < min(best, least):
                    least, risk = c, p
    return least, risk


@compiled
def bellman_sweep(
    grid: Samples, actions: Actions, nodes: Quadrature, goal: Goal, value: ValueFunction
) -> None:
    """Fill the value function, solving on `grid` from the tolerance outwards and interpolating."""
    step, cost, overshoot = value.step_m, value.cost, value.overshoot
    solved = int(goal.tolerance / step) + 1  # zero inside the tolerance
    before, cost_before, risk_before = goal.tolerance, 1.0, 0.0
    for n in range(grid.size):
        r = grid[n]
        best, risk = best_action(r, actions, nodes, goal, value, solved)
        aimed, aimed_risk = best_aimed_action(r, actions, nodes, goal, value, solved, best)
        if aimed < best:
            best, risk = aimed, aimed_risk
        if best == math.inf:  # nothing helps from here: as costly as an overshoot
            best, risk = goal.penalty, 1.0
        if n == 0:
            cost_before, risk_before = best, risk
        while solved < cost.size and solved * step <= r:
            part = (solved * step - before) / (r - before)
            cost[solved] = cost_before + part * (best - cost_before)
            overshoot[solved] = risk_before + part * (risk - risk_before)
            solved += 1
        before, cost_before, risk_before = r, best, risk


def graded_grid(first: float, last: float, step: float, ratio: float) -> Samples:
    """Increasing grid from `first` to `last` with steps of at least `step`, and of `ratio` further out."""
    points = [first]
    while points[-1] < last:
        points.append(points[-1] + max(step, ratio * points[-1]))
    return np.array(points)


def solve_value_function(table: Samples, nodes: Quadrature, goal: Goal) -> ValueFunction:
    """Sweep for one part: `table` (m) as from `quantile_table`, shape (velocities, strokes, q)."""
    furthest = float(np.nanmax(table[:, :, nodes.z.size // 2]))
    tolerance = goal.tolerance
    step = max(0.5 * tolerance, 2.5e-4 * furthest)
    grid = graded_grid(1.25 * tolerance, 5.0 * furthest, 0.5 * tolerance, 0.03)
    targets = graded_grid(min(0.5 * tolerance, LEAST_TARGET_M), furthest, 0.25 * tolerance, 0.03)
    targets = targets[targets <= furthest]
    actions = Actions(targets, taps_by_displacement(table, targets, nodes.z), AIMS)
    value = ValueFunction(step, np.zeros(int(grid[-1] / step)), np.zeros(int(grid[-1] / step)))
    bellman_sweep(grid, actions, nodes, goal, value)
    return value


def nearer(remaining: float) -> ValueFunction:
    """Value of being nearer, for a part that cannot be brought in yet: no overshoot but of the tap itself."""
    return ValueFunction(remaining, np.array([0.0, DISTANCE_WORTH]), np.zeros(2))
