"""Predictive distribution of the displacement, for many taps at once.

Uncertainty is split into the line along which friction varies (and, with it, whatever is correlated with
it), followed exactly at the nodes `z` whatever the displacement does there, and the directions across,
each taken at one standard deviation and added by `reach`.
"""

import math
from typing import NamedTuple

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.physics.closed_form import displacements
from impactcell.positioning.planner_posterior import FRICTION, PlannerPosterior
from impactcell.records import Samples

ACROSS = 4
"""Directions across the line: parameters other than friction."""


class Scenarios(NamedTuple):
    """What a tap may meet.

    `plants` are rows (k, b, mu_s, mu_k, k_v), shape (nodes + 2 ACROSS, 5): those along the line, then a
    standard deviation above and below it in each direction across. `part` as in `displacements`.
    """

    plants: Samples
    part: Samples


def parameter_scenarios(posterior: PlannerPosterior, z: Samples, part: Samples) -> Scenarios:
    """Draw up what a tap of this part may meet, along the line at the nodes z."""
    cov = posterior.cov.copy()
    cov[FRICTION, FRICTION] += posterior.scatter**2
    sigma = math.sqrt(cov[FRICTION, FRICTION])
    along = cov[FRICTION] / sigma
    across = cov[1:, 1:] - np.outer(along[1:], along[1:])
    values, vectors = np.linalg.eigh(across)
    steps = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    theta = np.empty((z.size + 2 * ACROSS, 5))
    theta[:] = posterior.mean
    theta[: z.size] += np.outer(z, along)
    # ln(1 + s z) to second order: a factor of friction is normal, not log-normal
    theta[: z.size, FRICTION] -= 0.5 * min(sigma, 0.1) ** 2 * z**2
    theta[z.size : z.size + ACROSS, 1:] += steps
    theta[z.size + ACROSS :, 1:] -= steps
    return Scenarios(plant_parameters(theta), part)


def plant_parameters(theta: Samples) -> Samples:
    """Rows (k, b, mu_s, mu_k, k_v) of rows of the belief's parameters."""
    rows = np.empty((theta.shape[0], 5))
    mu_k = np.exp(theta[:, 0])
    rows[:, 0] = np.exp(theta[:, 1])
    rows[:, 1] = np.exp(theta[:, 2])
    rows[:, 2] = mu_k * np.exp(np.maximum(theta[:, 3], 0.0))
    rows[:, 3] = mu_k
    rows[:, 4] = np.maximum(theta[:, 4], 0.0)
    return rows


@compiled
def displacement_quantiles(
    velocity: float, strokes: Samples, scenarios: Scenarios, z: Samples, out: Samples
) -> None:
    """Displacements at the nodes `z` for each stroke, written to `out`, shape (strokes, nodes), m."""
    rows, part = scenarios.plants, scenarios.part
    nodes, count = z.size, strokes.size
    middle = nodes // 2
    across = (rows.shape[0] - nodes) // 2
    course = np.empty(count)
    square = np.zeros(count)
    for q in range(nodes):
        displacements(velocity, strokes, rows[q], part, course)
        for j in range(count):
            out[j, q] = course[j]
    other = np.empty(count)
    for a in range(across):
        p, n = nodes + a, nodes + across + a
        displacements(velocity, strokes, rows[p], part, course)
        displacements(velocity, strokes, rows[n], part, other)
        for j in range(count):
            step = max(abs(course[j] - out[j, middle]), abs(other[j] - out[j, middle]))
            square[j] += step * step
    line = np.empty(nodes)
    for j in range(count):
        line[:] = out[j]
        aside = math.sqrt(square[j])
        for q in range(nodes):
            if q != middle:
                out[j, q] = max(reach(line, z, q, middle, aside), 0.0)


@compiled
def reach(line: Samples, z: Samples, q: int, middle: int, aside: float) -> float:
    """Displacement at node `q` with what lies across the line, one standard deviation `aside`, added.

    Where the displacement follows friction as usual (less friction, further) deviations add in
    quadrature. Elsewhere, and at least, it is the furthest (or nearest) displacement on the circle of
    radius |z_q| in the plane of the line and what lies across it: the first-order reliability method
    (Hasofer and Lind, 1974) on a line that is not straight.
    """
    usual = -1.0 if z[q] > 0.0 else 1.0
    radius = abs(z[q])
    centre = line[middle]
    deviation = line[q] - centre
    furthest = 0.0
    for n in range(z.size):
        if abs(z[n]) <= radius:
            value = (line[n] - centre) * usual + aside * math.sqrt(radius * radius - z[n] * z[n])
            furthest = max(furthest, value)
    if deviation * usual >= 0.0:
        furthest = max(furthest, math.hypot(deviation, aside * radius))
    elif furthest < 0.1 * abs(deviation):
        return float(
            line[q]
        )  # a fold of the displacement which all but the tap's own friction leaves in place
    return float(centre + usual * furthest)


@compiled
def quantile_table(velocities: Samples, strokes: Samples, scenarios: Scenarios, z: Samples) -> Samples:
    """Displacements (m), shape (velocities, strokes, nodes)."""
    table = np.empty((velocities.size, strokes.size, z.size))
    for i in range(velocities.size):
        displacement_quantiles(velocities[i], strokes, scenarios, z, table[i])
    return table
