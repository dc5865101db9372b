"""Which blocks of a driven record a model can be held to: those whose events hinge on nothing small."""

from dataclasses import replace

import numpy as np

from impactcell.discrepancy.data import IndexArray
from impactcell.discrepancy.model.least_squares import Fit
from impactcell.discrepancy.model.problem import Problem

FRICTION_CHANGE = 0.02
"""Relative change of friction that may not change what happens in a block."""
MAX_ASYMMETRY = 25.0
"""Ratio of the squared changes by more and by less friction beyond which events differ; alike they give 1."""
MAX_MISFIT_OVER_MEDIAN = 30.0
"""Times the median misfit beyond which the model does not follow a block."""
ACCEPTED_MISFIT = 4.0
"""Mean squared residual up to which a block is followed whatever the median."""


def decided_blocks(problem: Problem, model: Fit) -> IndexArray:
    """Blocks in which slightly more and slightly less friction change the motion alike.

    Where the drive comes within a hair of breaking the part away, or the part turns within a hair of
    sticking, noise decides what happens: one of the two makes another course of events.
    """
    problem = problem.with_effects(model.effects)
    kept = np.ones(problem.count, dtype=bool)
    ratio = next(
        i
        for i, coordinate in enumerate(model.coordinates)
        if coordinate.parameter == "ratio" and not coordinate.effect
    )
    for column in (ratio, None):
        size = []
        for nudge in (FRICTION_CHANGE, -FRICTION_CHANGE):
            theta, shot_parameters = model.theta.copy(), model.shot_parameters
            if column is None:
                shot_parameters = replace(shot_parameters, log_factor=shot_parameters.log_factor + nudge)
            else:
                theta[column] += nudge
            change = problem.residual(theta, shot_parameters) - model.residual
            size.append(np.add.reduceat(change**2, problem.shots.bounds[:-1]))
        more, less = np.maximum(*size), np.minimum(*size)
        kept &= ~(more > MAX_ASYMMETRY * np.maximum(less, problem.sizes))
    return np.flatnonzero(kept)


def usable_blocks(problem: Problem, model: Fit) -> IndexArray:
    """Blocks that are decided and that the model follows at all."""
    misfit = model.misfit(problem.shots) / problem.sizes
    limit = max(MAX_MISFIT_OVER_MEDIAN * float(np.median(misfit)), ACCEPTED_MISFIT)
    return np.intersect1d(decided_blocks(problem, model), np.flatnonzero(misfit <= limit))
