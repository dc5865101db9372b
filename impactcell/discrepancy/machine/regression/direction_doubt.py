"""How surely rows know the direction of friction where the part turns or rests, and what they weigh for it.

A part at rest is held by whatever friction balances the drive, and the moment at which it turns is known to
a sample or so: a row over such a place errs by a share of the friction, however quiet the sensors are.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from impactcell.discrepancy.machine.regression.weak_form import Rows
from impactcell.records import Samples

DIRECTION_STD = 1.0
"""Standard deviation of what is -1 or 1, the largest that anything between them can have: a part that stops
with the drive still on it is held by nearly all of its friction [1]."""
MOST_FLOORS = 1e6
"""Noise floors that a model may leave at most [1]."""
FLOORS_TRIED = 200
"""Of them that are tried, before what lies between two of them."""
FLOORS_TOLERANCE = 1e-6
"""Relative, of what a model leaves [1]."""


class DirectionDoubt(NamedTuple):
    """What goes by the direction of friction.

    Attributes
    ----------
    friction : float
        Level of friction [N or N m].
    floors : float
        What a model leaves where the direction is known [1 = noise floor].
    """

    friction: float = 0.0
    floors: float = 1.0


def row_weights(rows: Rows, doubt: DirectionDoubt) -> Samples:
    """Weight of each row by what is left of it in any case over that and its doubt, shape (n,).

    With u = DIRECTION_STD friction doubt and s² = floors² variance that is sqrt(s² / (s² + u²)): what is not
    known of its friction counts no more than what the model leaves.
    """
    if doubt.friction == 0.0:
        return np.ones_like(rows.target)
    left = doubt.floors**2 * rows.variance
    weight: Samples = np.sqrt(left / (left + _doubt(rows, doubt.friction)))
    return weight


def weighed(rows: Rows, doubt: DirectionDoubt) -> Rows:
    """Multiply rows by their weights; variances stay the sensors'."""
    if doubt.friction == 0.0:
        return rows
    weight = row_weights(rows, doubt)
    return replace(
        rows,
        target=weight * rows.target,
        columns={name: weight * values for name, values in rows.columns.items()},
    )


def floors_left(rows: Rows, residual: Samples, chosen: np.ndarray, friction: float) -> float:
    """Noise floors g, at least 1, that a model leaves beside the doubt of direction.

    Of the largest likelihood of r ~ N(0, g² variance + u²) over the rows that are `chosen`, r unweighed: rows
    that doubt outweighs tell next to nothing of g, however far u is from what they leave.
    """
    square, variance = residual[chosen] ** 2, rows.variance[chosen]
    doubt = _doubt(rows, friction)[chosen]

    def cost(log_floors: float) -> float:
        expected = math.exp(2.0 * log_floors) * variance + doubt
        return float(np.sum(np.log(expected) + square / expected))

    if not square.size:
        return 1.0
    if not np.isfinite(square).all():
        return MOST_FLOORS
    grid = np.linspace(0.0, math.log(MOST_FLOORS), FLOORS_TRIED)
    costs = [cost(log_floors) for log_floors in grid]
    best = int(np.argmin(costs))
    around = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    between = minimize_scalar(cost, bounds=around, method="bounded", options={"xatol": FLOORS_TOLERANCE})
    return math.exp(grid[best] if costs[best] <= between.fun else between.x)


def _doubt(rows: Rows, friction: float) -> Samples:
    """Variance of the friction of each row by its direction, shape (n,)."""
    variance: Samples = (DIRECTION_STD * friction * rows.doubt) ** 2
    return variance
