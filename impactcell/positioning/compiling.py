"""Compiles what planning needs, before the first part waits for it."""

from functools import cache

import numpy as np

from impactcell.positioning import model_hypotheses
from impactcell.positioning.action_selection import select_action
from impactcell.positioning.displacement_quantiles import parameter_scenarios
from impactcell.positioning.dynamic_programming import Goal
from impactcell.positioning.lookahead_table import PlannerLimits, build_lookahead, stiffest
from impactcell.positioning.quadrature import Z
from impactcell.positioning.safety_limits import largest_force
from impactcell.positioning.tap import Tap
from impactcell.positioning.tap_model import model_of_tap


@cache
def compile_planning() -> None:
    """Compile everything, or load it compiled, once a process: no planning step has to wait for it."""
    posterior = model_hypotheses.prior(6.5e5, 465.0, 0.2, 0.15, 0.0)
    limits = PlannerLimits(50e-6, 0.05, 4e-4, 1e3, 0.1)
    part, place = np.array([20.0, 9.81]), np.array([0.0, 1.0])
    lookahead = build_lookahead(limits, posterior, part, place)
    value = lookahead.outlook.value(limits, 1.0, 2e-3)
    space = limits.space(posterior, part, place, lookahead.strokes)
    select_action(
        2e-3, lookahead.table, value, space,
        parameter_scenarios(posterior, Z, part, place), Goal(50e-6, 100.0), 0.1,
    )  # fmt: skip
    tap = Tap(0.02, 2e-4)
    model_of_tap(tap, posterior, part)
    largest_force(tap.velocity_m_s, tap.stroke_m, stiffest(posterior, part, place), 20.0, 9.81)
