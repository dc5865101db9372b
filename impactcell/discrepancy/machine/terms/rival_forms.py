"""Free-form rivals of the terms: piecewise linear functions of one covariate in the same place.

A named effect is held against them: where only the free form does well, something else is missing.
"""

from collections.abc import Callable, Mapping

import numpy as np

from impactcell.discrepancy.machine.terms.catalogue import MotionState
from impactcell.physics.bspline import spline_basis
from impactcell.records import Samples

KNOTS = 7
"""Corners of a free form over the range that was gone through."""
SPLINE_PIECES = 16
"""Pieces of a cubic spline over the same: a bend a sixteenth of the range wide is followed [1]."""
FREE_FORMS: Mapping[str, str] = {
    "friction_over_speed": "-s(|q'|) sign(q')",
    "friction_over_load": "-s(|F + G sin(q - q_0)|) sign(q')",
    "friction_over_position": "-s(q) sign(q')",
    "force_over_position": "s(q)",
    "force_over_speed": "s(|q'|)",
}
"""Free forms and their place in the equation of motion."""
COVARIATES: Mapping[str, str] = {
    "friction_over_speed": "speed",
    "friction_over_load": "load",
    "friction_over_position": "position",
    "force_over_position": "position",
    "force_over_speed": "speed",
}
"""What each is a function of."""
SMOOTH_FORM = "force_over_velocity_and_position"
"""A smooth force of both, where no function in one place will do."""
EQUATIONS: Mapping[str, str] = {**FREE_FORMS, SMOOTH_FORM: "s(q', q)"}
"""Where each enters the equation of motion."""
PLACES: Mapping[str, str] = {
    "viscous_friction": "friction_over_speed",
    "quadratic_drag": "friction_over_speed",
    "stribeck_friction": "friction_over_speed",
    "directional_viscous_friction": "force_over_speed",
    "load_dependent_friction": "friction_over_load",
    "position_dependent_friction": "friction_over_position",
    "periodic_friction": "friction_over_position",
    "periodic_force": "force_over_position",
    "restoring_force": "force_over_position",
    "hardening_spring": "force_over_position",
}
"""The free form in whose place a term acts; terms that are not here have none."""


VALUES: Mapping[str, Callable[[MotionState], Samples]] = {
    "speed": lambda motion: np.abs(motion.velocity),
    "load": lambda motion: motion.load,
    "position": lambda motion: motion.position,
}
"""Values of each covariate in a motion."""
Ranges = Mapping[str, tuple[float, float]]
"""Range of each covariate that was gone through."""
FreeColumns = dict[tuple[str, float, int], Samples]
"""Columns of functions that nobody has named, shape (n,) each."""
Freedom = Callable[[MotionState, Samples, Ranges], FreeColumns]
"""Gives them by a motion, its direction (-1 to 1), and the range of each covariate."""


def hats(values: Samples, lower: float, upper: float) -> Samples:
    """Piecewise linear functions about the corners, constant beyond the ends."""
    knots = np.linspace(lower, upper, KNOTS)
    return np.stack([np.interp(values, knots, corner) for corner in np.eye(KNOTS)])


def splines(values: Samples, lower: float, upper: float) -> Samples:
    """Cubic B-splines, straight beyond the ends."""
    return spline_basis(values, lower, upper, SPLINE_PIECES).T


def columns_of_corners(motion: MotionState, direction: Samples, ranges: Ranges) -> FreeColumns:
    """Columns of all free forms made of corners."""
    return _columns(motion, direction, ranges, hats)


def columns_of_splines(motion: MotionState, direction: Samples, ranges: Ranges) -> FreeColumns:
    """Columns of all free forms made of cubic splines."""
    return _columns(motion, direction, ranges, splines)


def _columns(
    motion: MotionState,
    direction: Samples,
    ranges: Ranges,
    basis: Callable[[Samples, float, float], Samples],
) -> FreeColumns:
    columns: FreeColumns = {}
    for form, covariate in COVARIATES.items():
        lower, upper = ranges[covariate]
        functions = basis(VALUES[covariate](motion), lower, upper if upper > lower else lower + 1.0)
        sense = -direction if form.startswith("friction") else 1.0
        for number, values in enumerate(functions):
            columns[form, 0.0, number] = sense * values
    return columns
