"""The force that a part takes to be moved at all, for a limit that allows less."""

import math
from dataclasses import replace

from impactcell.positioning.lookahead_table import PlannerLimits, build_lookahead, stiffest
from impactcell.positioning.planner_posterior import PlannerPosterior
from impactcell.positioning.quadrature import COARSE_Z
from impactcell.positioning.safety_limits import largest_force
from impactcell.records import Samples


def force_needed(
    limits: PlannerLimits, posterior: PlannerPosterior, part: Samples, place: Samples, least_m: float
) -> float:
    """Bound on the contact force (N) of the gentlest tap that moves the part further; inf where none does.

    The limit of force is left aside; `part` and `place` as in
    `impactcell.positioning.displacement_quantiles.Scenarios`.
    """
    lookahead = build_lookahead(replace(limits, max_force_n=math.inf), posterior, part, place)
    plant, moved = stiffest(posterior, part, place), lookahead.table[:, :, COARSE_Z.size // 2]
    forces = [
        largest_force(velocity, stroke, plant, part[0], part[1])
        for velocity, displacements in zip(limits.velocities, moved, strict=True)
        for stroke, displacement in zip(lookahead.strokes, displacements, strict=True)
        if displacement > least_m
    ]
    return min(forces, default=math.inf)
