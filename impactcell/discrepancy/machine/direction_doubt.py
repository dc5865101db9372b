"""How surely rows know the direction of friction where the part turns or rests, and what they weigh for it.

A part at rest is held by whatever friction balances the drive, and the moment at which it turns is known to
a sample or so: a row over such a place errs by a share of the friction, however quiet the sensors are.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from impactcell.discrepancy.machine.weak_form import Rows
from impactcell.records import Samples

DIRECTION_STD = 1.0 / math.sqrt(3.0)
"""Standard deviation of what may be anything between -1 and 1."""
MOST_FLOORS = 1e6
"""Noise floors that a model may leave at most [1]."""


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

    Solves sum r² / (g² variance + u²) = n over the rows that are `chosen`, r unweighed.
    """
    square, variance = residual[chosen] ** 2, rows.variance[chosen]
    doubt = _doubt(rows, friction)[chosen]

    def excess(log_floors: float) -> float:
        return float(np.mean(square / (math.exp(2.0 * log_floors) * variance + doubt))) - 1.0

    if not square.size or excess(0.0) <= 0.0:
        return 1.0
    most = math.log(MOST_FLOORS)
    return math.exp(brentq(excess, 0.0, most)) if excess(most) < 0.0 else MOST_FLOORS


def _doubt(rows: Rows, friction: float) -> Samples:
    """Variance of the friction of each row by its direction, shape (n,)."""
    variance: Samples = (DIRECTION_STD * friction * rows.doubt) ** 2
    return variance
