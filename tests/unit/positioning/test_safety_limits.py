"""The limits of a cell: what is planned keeps to them, and is never refused for the last bit of a number."""

import numpy as np
import pytest

from impactcell.physics import Plant
from impactcell.positioning import SafetyLimits, TapPlanner
from impactcell.positioning.action_selection import select_action
from impactcell.positioning.displacement_quantiles import parameter_scenarios
from impactcell.positioning.lookahead_table import PlannerLimits, build_lookahead
from impactcell.positioning.quadrature import Z
from impactcell.positioning.safety_limits import allowed_strokes, largest_force
from impactcell.positioning.task_state_machine import PositioningCell, TaskState, begin_task

NOMINAL = Plant(stiffness_n_per_m=6.5e5, damping_n_s_per_m=465.0, mu_s=0.2, mu_k=0.152)
TRAVEL_M = (0.0, 40e-3)


@pytest.mark.parametrize("force_n", [40.0, 63.0, 90.0, 150.0])
def test_the_longest_stroke_keeps_the_force_to_the_bit(force_n: float) -> None:
    velocities = np.linspace(0.001, 0.08, 200)
    for stiffness in np.linspace(4e5, 9e5, 20):
        plant = np.array([stiffness, 465.0, 0.2, 0.152, 0.0])
        strokes = allowed_strokes(velocities, force_n, plant, 13.0, 9.81)
        bounds = [
            largest_force(v, s, plant, 13.0, 9.81)
            for v, s in zip(velocities, strokes, strict=True)
            if s > 0.0
        ]
        assert max(bounds) <= force_n
        assert max(bounds) > force_n * (1.0 - 1e-6)


def test_a_tap_planned_at_the_limit_of_force_is_allowed() -> None:
    """Before, the bound of two of these was 63.00000000000001 N, and their targets were refused."""
    planner = TapPlanner(tolerance_m=50e-6, plant=NOMINAL, two_sided=True, max_force_n=63.0)
    cell = PositioningCell("c", SafetyLimits(0.1, 1.5e-3, 63.0, TRAVEL_M), 1e-6, two_sided=True)
    forces = []
    for distance_m in np.geomspace(0.1e-3, 30e-3, 12):
        task = begin_task(
            TaskState(), cell, planner,
            target_m=5e-3 + float(distance_m), position_m=5e-3, mass_kg=13.0, trained=True,
        )  # fmt: skip
        assert task.tap is not None
        forces.append(planner.force(task.tap, 13.0))
    assert max(forces) > 62.999


def test_a_table_from_before_more_was_learned_leads_to_no_longer_stroke() -> None:
    """What presses harder than was thought when its table was made is not refined about its strokes there."""
    limits = PlannerLimits(50e-6, 0.1, 1.5e-3, 63.0, 1e-3)
    posterior = TapPlanner(plant=NOMINAL).posterior
    part, place = np.array([13.0, 9.81]), np.array([0.0, 1.0])
    lookahead = build_lookahead(limits, posterior, part, place)
    before = limits.space(posterior, part, place, lookahead.strokes)
    space = before._replace(longest_strokes=0.8 * before.longest_strokes)
    value = lookahead.outlook.value(limits, 1.0, 10e-3)
    scenarios = parameter_scenarios(posterior, Z, part, place)
    action, _ = select_action(
        10e-3, lookahead.table, value, space, scenarios, limits.goal(1.0), limits.overshoot_probability
    )
    assert action is not None
    longest = space.longest_strokes[np.abs(space.velocities - action.velocity_m_s).argmin()]
    assert action.stroke_m <= longest
