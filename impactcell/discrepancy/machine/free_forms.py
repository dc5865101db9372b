"""Free-form rivals of the terms: piecewise linear functions of one covariate in the same place.

A named effect is held against them: where only the free form does well, something else is missing.
"""

from collections.abc import Mapping

import numpy as np

from impactcell.discrepancy.machine.terms import MotionState
from impactcell.records import Samples

KNOTS = 7
"""Corners of a free form over the range that was gone through."""
FREE_FORMS: Mapping[str, str] = {
    "friction_over_speed": "-s(|q'|) sign(q')",
    "friction_over_load": "-s(|F + G sin(q - q_0)|) sign(q')",
    "friction_over_position": "-s(q) sign(q')",
    "force_over_position": "s(q)",
}
"""Free forms and their place in the equation of motion."""
COVARIATES: Mapping[str, str] = {
    "friction_over_speed": "speed",
    "friction_over_load": "load",
    "friction_over_position": "position",
    "force_over_position": "position",
}
"""What each is a function of."""
PLACES: Mapping[str, str] = {
    "viscous_friction": "friction_over_speed",
    "quadratic_drag": "friction_over_speed",
    "stribeck_friction": "friction_over_speed",
    "load_dependent_friction": "friction_over_load",
    "position_dependent_friction": "friction_over_position",
    "periodic_friction": "friction_over_position",
    "periodic_force": "force_over_position",
    "restoring_force": "force_over_position",
    "hardening_spring": "force_over_position",
}
"""The free form in whose place a term acts; terms that are not here have none."""


def free_columns(
    motion: MotionState, direction: Samples, largest: tuple[float, float], positions: tuple[float, float]
) -> dict[tuple[str, float, int], Samples]:
    """Columns of all free forms, shape (n,) each.

    Parameters
    ----------
    motion : MotionState
    direction : ndarray, shape (n,)
    largest : (float, float)
        Speed and load.
    positions : (float, float)
        Range of the positions.
    """
    by_speed = _hats(np.abs(motion.velocity), np.linspace(0.0, largest[0], KNOTS))
    by_load = _hats(motion.load, np.linspace(0.0, max(largest[1], 1e-300), KNOTS))
    by_place = _hats(motion.position, np.linspace(*positions, KNOTS))
    columns: dict[tuple[str, float, int], Samples] = {}
    for number in range(KNOTS):
        columns["friction_over_speed", 0.0, number] = -direction * by_speed[number]
        columns["friction_over_load", 0.0, number] = -direction * by_load[number]
        columns["friction_over_position", 0.0, number] = -direction * by_place[number]
        columns["force_over_position", 0.0, number] = by_place[number]
    return columns


def _hats(values: Samples, knots: Samples) -> Samples:
    """Hat functions about the knots, shape (knots, n); constant beyond the ends."""
    corners = np.eye(len(knots))
    return np.stack([np.interp(values, knots, corner) for corner in corners])
