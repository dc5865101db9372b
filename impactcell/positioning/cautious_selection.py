"""The tap of least expected cost within the bound on overshoot, with as little caution as that takes."""

import math

import numpy as np

from impactcell.positioning.action_selection import ActionSpace, Allowed, SelectedAction, select_action
from impactcell.positioning.displacement_quantiles import Scenarios
from impactcell.positioning.dynamic_programming import nearer
from impactcell.positioning.lookahead_table import LookaheadTable, PlannerLimits
from impactcell.positioning.posterior_update import STILL

CAUTION = (1.0, 20.0, 400.0)  # factors on the penalty of an overshoot, tried until a tap is within the bound
SHARE_OF_A_STEP = 0.2
"""Of the bound on overshoot, for a tap that only brings the part nearer, so that more is learned there."""
WORTH_A_STEP = 0.05
"""Of the remaining distance that such a tap has to come nearer by."""
LEAST_STEP_M = 1e-6
"""An encoder's resolution: a tap that is to move less is made only where there is no other."""


def least_step_m(noise_m: float) -> float:
    """Return the displacement (m) below which none can be told, measured with this standard deviation."""
    return max(LEAST_STEP_M, STILL * noise_m)


def choose_action(
    distance: float, lookahead: LookaheadTable, limits: PlannerLimits, space: ActionSpace,
    scenarios: Scenarios, allowed: Allowed | None = None,
) -> tuple[SelectedAction | None, float]:  # fmt: skip
    """Choose a tap at this distance (m); None, and the least overshoot met, where none is within the bound.

    `allowed`: of the taps of `space`; without it all are.
    """
    table, bound = lookahead.at(scenarios.place), limits.overshoot_probability
    if allowed is not None:
        kept = np.array([allowed(velocity, space.strokes) for velocity in space.velocities])
        table = np.where(kept[:, :, None], table, math.nan)
    least, hardly = 1.0, None
    for caution in CAUTION:
        value, goal = lookahead.outlook.value(limits, caution, distance), limits.goal(caution)
        action, safest = select_action(distance, table, value, space, scenarios, goal, bound, allowed)
        if action is not None and action.mean >= LEAST_STEP_M:
            return action, safest
        least, hardly = min(least, safest), hardly or action
    step, _ = select_action(
        distance, table, nearer(distance), space, scenarios, goal, SHARE_OF_A_STEP * bound, allowed
    )
    if step is not None and step.mean >= WORTH_A_STEP * distance:
        return step, least
    return hardly, least
