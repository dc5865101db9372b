"""Predictive distribution of the displacement, for many taps at once.

Uncertainty is split into the line along which friction varies (and, with it, whatever is correlated with
it), followed exactly at the nodes `Z` whatever the displacement does there, and the directions across,
each taken at one standard deviation and added in quadrature.
"""

import math

import numpy as np

from impactcell.compiled import compiled
from impactcell.positioning.belief import FRICTION, Belief
from impactcell.positioning.response import displacements
from impactcell.records import Samples

Z = np.array([-4.2, -3.3, -2.6, -1.9, -1.2, -0.6, 0.0, 0.6, 1.2, 1.9, 2.6, 3.3, 4.2])
MIDDLE = 6
ACROSS = 4


def scenarios(belief: Belief) -> Samples:
    """Parameter rows (k, b, mu_s, mu_k, k_v), shape (len(Z) + 2 * ACROSS, 5): the line, then +-1 across."""
    cov = belief.cov.copy()
    cov[FRICTION, FRICTION] += belief.scatter**2
    sigma = math.sqrt(cov[FRICTION, FRICTION])
    along = cov[FRICTION] / sigma
    across = cov[1:, 1:] - np.outer(along[1:], along[1:])
    values, vectors = np.linalg.eigh(across)
    steps = (vectors * np.sqrt(np.maximum(values, 0.0))).T
    theta = np.empty((Z.size + 2 * ACROSS, 5))
    theta[:] = belief.mean
    theta[: Z.size] += np.outer(Z, along)
    # ln(1 + s z) to second order: a factor of friction is normal, not log-normal
    theta[: Z.size, FRICTION] -= 0.5 * min(sigma, 0.1) ** 2 * Z**2
    theta[Z.size : Z.size + ACROSS, 1:] += steps
    theta[Z.size + ACROSS :, 1:] -= steps
    return plants(theta)


def plants(theta: Samples) -> Samples:
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
def distribution(
    velocity: float, strokes: Samples, rows: Samples, z: Samples, mass: float, gravity: float,
    out: Samples,
) -> None:  # fmt: skip
    """Displacements at the nodes `z` for each stroke, written to `out`, shape (strokes, nodes), m.

    `rows` as from `scenarios`. Directions across are added in quadrature to the deviation from the
    middle node, keeping its sign; where a node deviates to the wrong side by less, friction's usual side
    (less friction, further) is taken, which errs to the side of overshoot.
    """
    nodes, count = z.size, strokes.size
    middle = nodes // 2
    across = (rows.shape[0] - nodes) // 2
    course = np.empty(count)
    square = np.zeros(count)
    for q in range(nodes):
        displacements(velocity, strokes, rows[q], mass, gravity, course)
        for j in range(count):
            out[j, q] = course[j]
    other = np.empty(count)
    for a in range(across):
        p, n = nodes + a, nodes + across + a
        displacements(velocity, strokes, rows[p], mass, gravity, course)
        displacements(velocity, strokes, rows[n], mass, gravity, other)
        for j in range(count):
            step = max(abs(course[j] - out[j, middle]), abs(other[j] - out[j, middle]))
            square[j] += step * step
    for j in range(count):
        centre = out[j, middle]
        for q in range(nodes):
            if q == middle:
                continue
            deviation = out[j, q] - centre
            aside = abs(z[q]) * math.sqrt(square[j])
            usual = -1.0 if z[q] > 0.0 else 1.0
            if deviation * usual >= 0.0:
                out[j, q] = centre + usual * math.sqrt(deviation * deviation + aside * aside)
            elif aside > abs(deviation):
                out[j, q] = centre + usual * aside
            out[j, q] = max(out[j, q], 0.0)


@compiled
def spread_table(
    velocities: Samples, strokes: Samples, rows: Samples, z: Samples, mass: float, gravity: float
) -> Samples:  # fmt: skip
    """Displacements (m), shape (velocities, strokes, nodes)."""
    table = np.empty((velocities.size, strokes.size, z.size))
    for i in range(velocities.size):
        distribution(velocities[i], strokes, rows, z, mass, gravity, table[i])
    return table
