"""Predictive distribution of the displacement, for many taps at once.

Uncertainty is split into the line along which friction varies (and, with it, whatever is correlated with
it), followed exactly at the nodes `z` whatever the displacement does there, and the directions across,
each taken at three standard deviations and added by `reach`: where a slow push sticks once more, or once
less, the displacement jumps by up to a fifth of the indentation, and a slope taken near the mean knows
nothing of it. Parameters theta are those of `impactcell.positioning.planner_posterior`, the weights w and the
features psi, phi and beta those of `impactcell.positioning.displacement_discrepancy`.
"""

import math
from typing import NamedTuple

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.physics.closed_form import displacements
from impactcell.positioning.displacement_discrepancy import (
    BREAKAWAY,
    BREAKAWAY_SHARE,
    FEATURES,
    HALTING_STD,
    SWING_SHARE,
    breakaway_features,
    discrepancy_features,
    halting_m,
    indentation_features,
    swing_m,
)
from impactcell.positioning.model_hypotheses import swing_std
from impactcell.positioning.parameter_directions import ACROSS, ACROSS_Z, directions_of
from impactcell.positioning.planner_posterior import (
    DAMPING,
    FRICTION,
    PARAMETERS,
    RATIO,
    STIFFNESS,
    VISCOUS,
    PlannerPosterior,
)
from impactcell.positioning.scatter_hypotheses import quantile_scales
from impactcell.records import Samples

WIDEST_CORRECTED = 0.1
"""Std of ln(mu_k) up to which its skewness is corrected for: what is wider is a sum of several."""
FOLD_SHARE = 0.1
"""Share of a node's own deviation below which what lies about it does not reach: the line folds there."""
SHORTEST_SHIFT_M = 1e-6
"""Least shift of a stroke over which the slope of the displacement is taken: an encoder's resolution."""


class Scenarios(NamedTuple):
    """What a tap may meet.

    Attributes
    ----------
    plants : ndarray, shape (nodes + 2 ACROSS, 5)
        Rows (k, b, mu_s, mu_k, k_v): those along the line, then `ACROSS_Z` standard deviations above and
        below it in each direction across.
    weights : ndarray, shape (nodes + 2 ACROSS, FEATURES)
        Of the discrepancy, with each of these.
    root : ndarray, shape (FEATURES, FEATURES)
        root @ root.T is the covariance of the weights that goes with no parameter.
    scatter : ndarray, shape (nodes, 2)
        Of the displacement and of the contact, at each node.
    part, place : ndarray
        As in `displacements` and in `discrepancy_features`.
    swing_std : float
        Of what the swing of a pushed part is off by, of `swing_m`.
    """

    plants: Samples
    weights: Samples
    root: Samples
    scatter: Samples
    part: Samples
    place: Samples
    swing_std: float


def parameter_scenarios(
    posterior: PlannerPosterior, z: Samples, part: Samples, place: Samples, swing: float | None = None
) -> Scenarios:
    """Draw up what a tap of this part at this place may meet, along the line at the nodes z.

    `swing` is `Scenarios.swing_std` where it is not the posterior's own.
    """
    known = directions_of(posterior, float(part[0]), float(place[0]))
    cov, steps, weights_along = known.cov, known.steps, known.weights_along
    scales = quantile_scales(posterior.scatter_scores, z)
    sigma = np.sqrt(cov[FRICTION, FRICTION] + scales[:, 0] ** 2)
    along = cov[FRICTION] / sigma[:, None]
    along[:, FRICTION] = sigma
    theta = np.empty((z.size + 2 * ACROSS, PARAMETERS + FEATURES))
    theta[:] = known.mean
    theta[: z.size] += z[:, None] * along
    # ln(1 + s z) to second order: a factor of friction is normal, not log-normal
    theta[: z.size, FRICTION] -= 0.5 * np.minimum(sigma, WIDEST_CORRECTED) ** 2 * z**2
    theta[z.size : z.size + ACROSS, 1:PARAMETERS] += steps
    theta[z.size + ACROSS :, 1:PARAMETERS] -= steps
    theta[z.size : z.size + ACROSS, PARAMETERS:] += weights_along
    theta[z.size + ACROSS :, PARAMETERS:] -= weights_along
    weights = np.ascontiguousarray(theta[:, PARAMETERS:])
    return Scenarios(
        plant_parameters(theta),
        weights,
        known.root,
        np.ascontiguousarray(scales[:, 1:]),
        part,
        place,
        swing_std(posterior) if swing is None else swing,
    )


def plant_parameters(theta: Samples) -> Samples:
    """Rows (k, b, mu_s, mu_k, k_v) of rows theta."""
    rows = np.empty((theta.shape[0], 5))
    mu_k = np.exp(theta[:, FRICTION])
    rows[:, 0] = np.exp(theta[:, STIFFNESS])
    rows[:, 1] = np.exp(theta[:, DAMPING])
    rows[:, 2] = mu_k * np.exp(np.maximum(theta[:, RATIO], 0.0))
    rows[:, 3] = mu_k
    rows[:, 4] = np.maximum(theta[:, VISCOUS], 0.0)
    return rows


@compiled
def displacement_quantiles(
    velocity: float, strokes: Samples, scenarios: Scenarios, z: Samples, out: Samples
) -> None:
    """Displacements at the nodes `z` for each stroke, written to `out`, shape (strokes, nodes), m.

    A direction across with a displacement on one side only, as of a push without a stroke that might not
    end on the other, reaches as far on both; with none on either side all are nan.
    """
    rows, part, weights = scenarios.plants, scenarios.part, scenarios.weights
    nodes, count = z.size, strokes.size
    middle = nodes // 2
    across = (rows.shape[0] - nodes) // 2
    depth = rows[middle, 3] * part[0] * part[1] / rows[middle, 0]
    psi = np.empty(weights.shape[1])
    indentation_features(velocity, part, scenarios.place, psi)
    psi_root = psi @ scenarios.root
    moved, moved_other = np.empty(count), np.empty(count)
    square = np.zeros(count)
    size = weights.shape[1]
    features, at_breakaway = np.empty((size, count)), np.zeros((size, count))
    tap = np.empty(3)
    shift = depth * product(psi, weights[middle])
    tap[1], tap[2] = depth, rows[middle, 3]
    displacements(velocity, strokes + shift, rows[middle], part, moved)
    for j in range(count):
        tap[0] = strokes[j] + shift
        discrepancy_features(tap, moved[j], part, scenarios.place, features[:, j])
        breakaway_features(velocity, strokes[j], depth, at_breakaway[:, j])
    at_breakaway *= depth
    longer_m = max(depth * math.sqrt(product(psi_root, psi_root)), SHORTEST_SHIFT_M)
    displacements(velocity, strokes + shift + longer_m, rows[middle], part, moved_other)
    slope = (moved_other - moved) * (depth / longer_m)  # of the displacement over psi · w
    swings = np.zeros(count)
    if scenarios.swing_std > 0.0:
        before, after = np.empty(count), np.empty(count)
        displacements(velocity, (1.0 - SWING_SHARE) * strokes + shift, rows[middle], part, before)
        displacements(velocity, (1.0 + SWING_SHARE) * strokes + shift, rows[middle], part, after)
        for j in range(count):
            swings[j] = scenarios.swing_std * swing_m(before[j], moved[j], after[j], strokes[j], depth)
    add_discrepancy(moved, features, at_breakaway, weights[middle])
    out[:, middle] = moved
    for q in range(nodes):
        if q != middle:
            displacements(velocity, strokes + depth * product(psi, weights[q]), rows[q], part, moved)
            add_discrepancy(moved, features, at_breakaway, weights[q])
            out[:, q] = moved
    for a in range(across):
        above, below = nodes + a, nodes + across + a
        displacements(velocity, strokes + depth * product(psi, weights[above]), rows[above], part, moved)
        displacements(
            velocity, strokes + depth * product(psi, weights[below]), rows[below], part, moved_other
        )
        add_discrepancy(moved, features, at_breakaway, weights[above])
        add_discrepancy(moved_other, features, at_breakaway, weights[below])
        for j in range(count):
            up, down = abs(moved[j] - out[j, middle]), abs(moved_other[j] - out[j, middle])
            further = up if math.isnan(down) else max(down, up)  # down where above there is none
            square[j] += (further / ACROSS_Z) ** 2
    root, sliding_step, breakaway_step = scenarios.root, np.empty(count), np.empty(count)
    for a in range(root.shape[1]):
        along_weights(features, root[:, a], sliding_step)
        along_weights(at_breakaway, root[:, a], breakaway_step)
        for j in range(count):
            square[j] += (out[j, middle] * sliding_step[j] + breakaway_step[j] + slope[j] * psi_root[a]) ** 2
    line = np.empty(nodes)
    for j in range(count):
        line[:] = out[j]
        indented_m = max(abs(slope[j]), (1.0 - features[0, j]) * min(depth, line[middle]))
        indented_m = max(indented_m, BREAKAWAY_SHARE * at_breakaway[BREAKAWAY, j])
        square[j] += (HALTING_STD * halting_m(line[middle], strokes[j])) ** 2 + swings[j] ** 2
        if math.isnan(square[j]):
            out[j] = math.nan
            continue
        for q in range(nodes):
            if q != middle:
                by_itself = scenarios.scatter[q, 0] * line[middle]
                by_contact = scenarios.scatter[q, 1] * indented_m
                aside = math.sqrt(square[j] + by_itself**2 + by_contact**2)
                out[j, q] = max(reach(line, z, q, middle, aside), 0.0)


@compiled
def add_discrepancy(moved: Samples, features: Samples, at_breakaway: Samples, weights: Samples) -> None:
    """Add the discrepancy phi and delta beta to displacements (m), that of psi being in them already.

    `features` and `at_breakaway`, shape (FEATURES, strokes), have phi and delta beta.
    """
    sliding, breaking = np.empty(moved.size), np.empty(moved.size)
    along_weights(features, weights, sliding)
    along_weights(at_breakaway, weights, breaking)
    for j in range(moved.size):
        moved[j] = max(moved[j] * math.exp(sliding[j]) + breaking[j], 0.0)


@compiled
def along_weights(features: Samples, weights: Samples, out: Samples) -> None:
    """Write the scalar product of each column of `features` with the weights to `out`."""
    out[:] = 0.0
    for n in range(weights.size):
        for j in range(out.size):
            out[j] += features[n, j] * weights[n]


@compiled
def product(a: Samples, b: Samples) -> float:
    """Scalar product of two short vectors."""
    total = 0.0
    for n in range(a.size):
        total += a[n] * b[n]
    return total


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
    elif furthest < FOLD_SHARE * abs(deviation):
        # a fold of the displacement which all but the tap's own friction leaves in place
        return float(line[q])
    return float(centre + usual * furthest)


@compiled
def quantile_table(velocities: Samples, strokes: Samples, scenarios: Scenarios, z: Samples) -> Samples:
    """Displacements (m), shape (velocities, strokes, nodes)."""
    table = np.empty((velocities.size, strokes.size, z.size))
    for i in range(velocities.size):
        displacement_quantiles(velocities[i], strokes, scenarios, z, table[i])
    return table
