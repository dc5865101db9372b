"""Fewest taps by dynamic programming, for somebody who knows plant, friction and scatter of a cell exactly.

Written apart from the planner's own sweep: a finer grid, many more taps for each displacement, 21 nodes of
friction, and a multiplier searched for each task, so that the bound on overshoot is used up and not more.
"""

import math

import numpy as np
from numpy.typing import NDArray

from impactcell.numerics.jit import compiled
from impactcell.physics.closed_form import displacements

Samples = NDArray[np.float64]

BANDS = 6  # of velocity, in each of which the best taps for a displacement are kept
CRITERIA = 3  # least spread, least reach upwards, least reach downwards
MULTIPLIERS = (25.0, 60.0, 120.0, 250.0, 500.0, 2000.0)
Z = np.linspace(-4.2, 4.2, 21)
VELOCITIES = np.geomspace(0.004, 0.1, 40)
STROKES = np.concatenate([np.linspace(4e-6, 3e-4, 50, endpoint=False), np.linspace(3e-4, 1.5e-3, 50)])


@compiled
def tail(z: float) -> float:
    value: float = 0.5 * math.erfc(z / math.sqrt(2.0))
    return value


@compiled
def outcomes(velocities: Samples, strokes: Samples, factors: Samples, plant: Samples, mass: float) -> Samples:
    table = np.empty((velocities.size, strokes.size, factors.size))
    scaled, out, part = plant.copy(), np.empty(strokes.size), np.array([mass, 9.81])
    for q in range(factors.size):
        scaled[2], scaled[3] = plant[2] * factors[q], plant[3] * factors[q]
        for i in range(velocities.size):
            displacements(velocities[i], strokes, scaled, part, out)
            table[i, :, q] = out
    return table


@compiled
def best_taps(table: Samples, wanted: Samples) -> Samples:
    nodes = table.shape[2]
    half = nodes // 2
    slots = BANDS * CRITERIA
    kept = np.full((wanted.size, slots, nodes), np.nan)
    score = np.full((wanted.size, slots), np.inf)
    row, value = np.empty(nodes), np.empty(CRITERIA)
    for i in range(table.shape[0]):
        band = i * BANDS // table.shape[0]
        for j in range(table.shape[1] - 1):
            a, b = table[i, j, half], table[i, j + 1, half]
            if not (a > 0.0 and b > 0.0 and a != b):
                continue
            n = np.searchsorted(wanted, min(a, b))
            while n < wanted.size and wanted[n] <= max(a, b):
                part = (wanted[n] - a) / (b - a)
                value[:] = 0.0
                for q in range(nodes):
                    row[q] = (1.0 - part) * table[i, j, q] + part * table[i, j + 1, q]
                    if q > 4 and q < nodes - 5:
                        value[0] += (row[q] - wanted[n]) ** 2
                    value[1] = max(value[1], row[q] - wanted[n])
                    value[2] = max(value[2], wanted[n] - row[q])
                for c in range(CRITERIA):
                    if value[c] < score[n, band * CRITERIA + c]:
                        score[n, band * CRITERIA + c] = value[c]
                        kept[n, band * CRITERIA + c] = row
                n += 1
    return kept


@compiled
def read(grid: Samples, values: Samples, known: int, r: float) -> float:
    n = np.searchsorted(grid[:known], r)
    if n == 0:
        return float(values[0])
    if n >= known:
        return float(values[known - 1])
    part = (r - grid[n - 1]) / (grid[n] - grid[n - 1])
    return float(values[n - 1] + part * (values[n] - values[n - 1]))


@compiled
def value_of(
    r: float, moved: Samples, z: Samples, tolerance: float, multiplier: float, grid: Samples, cost: Samples,
    taps: Samples, over: Samples, known: int, bound: float,
) -> tuple[float, float, float]:  # fmt: skip
    total, count, risk, stays = 1.0, 1.0, 0.0, 0.0
    for q in range(z.size - 1):
        a, b = r - moved[q], r - moved[q + 1]
        low = 0.0 if q == z.size - 2 else tail(z[q + 1])
        high = 1.0 if q == 0 else tail(z[q])
        # four equal pieces of the interval between two nodes
        for piece in range(4):
            share = (high - low) / 4.0
            left = a + (b - a) * (piece + 0.5) / 4.0
            if left < -tolerance:
                total += share * multiplier
                risk += share
            elif left > tolerance:
                if known == 0 or left > grid[known - 1]:
                    stays += share
                else:
                    total += share * read(grid, cost, known, left)
                    count += share * read(grid, taps, known, left)
                    risk += share * read(grid, over, known, left)
        if total > bound:
            return np.inf, np.inf, 1.0
    if stays > 0.5:
        return np.inf, np.inf, 1.0
    return total / (1.0 - stays), count / (1.0 - stays), risk / (1.0 - stays)


@compiled
def solve(
    grid: Samples, wanted: Samples, every: Samples, which: NDArray[np.int64], z: Samples, tolerance: float,
    multiplier: float,
) -> tuple[Samples, Samples]:  # fmt: skip
    cost, taps, over = np.zeros(grid.size), np.zeros(grid.size), np.zeros(grid.size)
    row = np.empty(z.size)
    aims = np.array([-0.6, -0.3, 0.0, 0.3, 0.6, 0.9, 1.3, 1.8, 2.4])
    for n in range(grid.size):
        r = grid[n]
        kept = every[which[n]]
        best, count, risk = np.inf, np.inf, 1.0
        last = np.searchsorted(wanted, r + tolerance)
        for back in range(last):
            m = last - 1 - back
            if wanted[m] < 0.15 * r and wanted[m] < 0.4 * wanted[wanted.size - 1]:
                break
            if r - wanted[m] > tolerance and 1.0 + read(grid, cost, n, r - wanted[m]) > best + 1.0:
                continue
            for s in range(kept.shape[1]):
                if kept[m, s, 0] == kept[m, s, 0]:
                    c, t, p = value_of(
                        r, kept[m, s], z, tolerance, multiplier, grid, cost, taps, over, n, best
                    )  # fmt: skip
                    if c < best:
                        best, count, risk = c, t, p
        for aim in aims:
            target = r - aim * tolerance
            m = np.searchsorted(wanted, target)
            if m == 0 or m >= wanted.size:
                continue
            part = (target - wanted[m - 1]) / (wanted[m] - wanted[m - 1])
            for s in range(kept.shape[1]):
                row[:] = (1.0 - part) * kept[m - 1, s] + part * kept[m, s]
                if row[0] == row[0]:
                    c, t, p = value_of(r, row, z, tolerance, multiplier, grid, cost, taps, over, n, best)
                    if c < best:
                        best, count, risk = c, t, p
        if best == np.inf:
            best, count, risk = multiplier, 0.0, 1.0
        cost[n], taps[n], over[n] = best, count, risk
    return taps, over


def fewest_taps(
    remaining_m: float, mass_kg: float, plant: Samples, scatter: float, tolerance_m: float, bound: float
) -> tuple[float, float]:
    """Expected taps of the best policy within `bound` on overshoot, and its overshoot probability."""
    table = outcomes(VELOCITIES, STROKES, 1.0 + scatter * Z, plant, mass_kg)
    return fewest_of(table[None], np.array([remaining_m]), remaining_m, tolerance_m, bound)


def fewest_of(
    tables: Samples, distances_m: Samples, remaining_m: float, tolerance_m: float, bound: float
) -> tuple[float, float]:
    """The same by the outcomes of taps, shape (p, velocities, strokes, nodes), at p remaining distances.

    A part that lies elsewhere is struck with the outcomes of the nearest of these distances.
    """
    half = Z.size // 2
    furthest = float(np.nanmax(tables[:, :, :, half]))

    def grown(first: float, last: float, step: float, ratio: float) -> Samples:
        points = [first]
        while points[-1] < last:
            points.append(points[-1] + max(step, ratio * points[-1]))
        return np.array(points)

    grid = grown(1.05 * tolerance_m, remaining_m, 0.3 * tolerance_m, 0.012)
    grid[-1] = max(remaining_m, grid[-2] * 1.0001)
    which = np.abs(np.log(grid[:, None] / distances_m)).argmin(axis=1)
    wanted = grown(min(3e-6, 0.3 * tolerance_m), furthest, 0.2 * tolerance_m, 0.02)
    wanted = wanted[wanted <= furthest]
    kept = np.array([best_taps(table, wanted) for table in tables])
    before = (math.nan, math.nan)
    for multiplier in MULTIPLIERS:
        every, over = solve(grid, wanted, kept, which, Z, tolerance_m, multiplier)
        taps, risk = float(every[-1]), float(over[-1])
        if risk <= bound:
            if math.isfinite(before[0]) and before[0] < taps:
                # a lot drawn between the two policies uses the bound up exactly
                part = (bound - risk) / (before[1] - risk)
                return taps + part * (before[0] - taps), bound
            return taps, risk
        before = (taps, risk)
    return before
