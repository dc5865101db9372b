"""What is not known of a part's parameters: along friction, and in the directions across that line."""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from impactcell.positioning.planner_posterior import FRICTION, PARAMETERS, PlannerPosterior, cov_at, mean_at
from impactcell.records import Samples

ACROSS = 4
"""Directions across the line: parameters other than friction."""
ACROSS_Z = 3.0
"""Standard deviations at which these are taken: beyond lies 1 in 1000, which is what is promised."""


class Directions(NamedTuple):
    """What is known of a part where it lies: mean and covariance, and what lies across the line of friction.

    `steps` and `weights_along`, shape (ACROSS, ...), are those of parameters and weights, `ACROSS_Z` standard
    deviations in each direction; `root` is as in `Scenarios`.
    """

    mean: Samples
    cov: Samples
    steps: Samples
    weights_along: Samples
    root: Samples


@lru_cache(maxsize=2)
def directions_of(posterior: PlannerPosterior, mass_kg: float, position_m: float) -> Directions:
    """Directions of what is known of a part of this mass at this place; a step asks for them twice."""
    part, place = np.array([mass_kg]), np.array([position_m])
    cov = cov_at(posterior, part, place)
    mean_line = cov[FRICTION] / math.sqrt(cov[FRICTION, FRICTION] + posterior.scatter**2)
    across = cov[1:, 1:] - np.outer(mean_line[1:], mean_line[1:])
    others = PARAMETERS - 1
    values, vectors = np.linalg.eigh(across[:others, :others])
    lengths = np.sqrt(np.maximum(values, 0.0))
    steps = ACROSS_Z * (vectors * lengths).T
    # weights of the discrepancy that go with each of these directions, and covariance that is left of theirs
    weights_along = (across[others:, :others] @ vectors / np.maximum(lengths, 1e-12)).T
    weights_left = across[others:, others:] - weights_along.T @ weights_along
    weights_along *= ACROSS_Z
    variances, axes = np.linalg.eigh(weights_left)
    root = np.ascontiguousarray(axes * np.sqrt(np.maximum(variances, 0.0)))
    return Directions(mean_at(posterior, part, place), cov, steps, weights_along, root)
