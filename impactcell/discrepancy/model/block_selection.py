"""Which blocks of a driven record a model can be held to: those whose events hinge on nothing small."""

from dataclasses import replace

import numpy as np

from impactcell.discrepancy.data.shots import Index
from impactcell.discrepancy.model.fit import Fit
from impactcell.discrepancy.model.problem import Problem

NUDGE = 0.02
"""Relative change of friction that may not change what happens in a block."""
LOPSIDED = 25.0
LOST = 30.0
FOLLOWED = 4.0


def decided(problem: Problem, model: Fit) -> Index:
    """Blocks in which slightly more and slightly less friction change the motion alike.

    Where the drive comes within a hair of breaking the part away, or the part turns within a hair of
    sticking, noise decides what happens: one of the two makes another course of events.
    """
    kept = np.ones(problem.count, dtype=bool)
    ratio = next(i for i, one in enumerate(model.coordinates) if one.parameter == "ratio" and not one.effect)
    for column in (ratio, None):
        size = []
        for nudge in (NUDGE, -NUDGE):
            at, local = model.at.copy(), model.local
            if column is None:
                local = replace(local, log_factor=local.log_factor + nudge)
            else:
                at[column] += nudge
            change = problem.residual(model.effects, at, local) - model.residual
            size.append(np.add.reduceat(change**2, problem.shots.bounds[:-1]))
        more, less = np.maximum(*size), np.minimum(*size)
        kept &= ~(more > LOPSIDED * np.maximum(less, problem.sizes))
    return np.flatnonzero(kept)


def followed(problem: Problem, model: Fit) -> Index:
    """Blocks that are decided and that the model follows at all."""
    misfit = model.misfit(problem.shots) / problem.sizes
    limit = max(LOST * float(np.median(misfit)), FOLLOWED)
    return np.intersect1d(decided(problem, model), np.flatnonzero(misfit <= limit))
