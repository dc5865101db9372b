"""The band that holds 99.9 % of the displacements by a tap, and the tap that tells it."""

import numpy as np

from impactcell.positioning.action_selection import SelectedAction
from impactcell.positioning.displacement_quantiles import displacement_quantiles, parameter_scenarios
from impactcell.positioning.planner_posterior import PlannerPosterior
from impactcell.positioning.tap import Tap
from impactcell.records import Samples

BAND_Z = np.linspace(-3.29, 3.29, 67)  # close together, since a displacement may fold over


def displacement_band(
    posterior: PlannerPosterior, velocity: float, strokes: Samples, part: Samples, place: Samples
) -> Samples:
    """Displacements (m) by each stroke at the nodes `BAND_Z`, shape (strokes, nodes).

    Parameters
    ----------
    velocity : float
        m/s.
    strokes : ndarray
        Increasing, m.
    part, place : ndarray
        As in `impactcell.positioning.displacement_quantiles.Scenarios`.
    """
    moved = np.empty((strokes.size, BAND_Z.size))
    scenarios = parameter_scenarios(posterior, BAND_Z, part, place)
    displacement_quantiles(velocity, strokes, scenarios, BAND_Z, moved)
    return moved


def tap_of(action: SelectedAction, posterior: PlannerPosterior, part: Samples, place: Samples) -> Tap:
    """Make the tap of an action, with the band of its displacement."""
    stroke = np.array([action.stroke_m])
    moved = displacement_band(posterior, action.velocity_m_s, stroke, part, place)[0]
    return Tap(
        velocity_m_s=action.velocity_m_s,
        stroke_m=action.stroke_m,
        direction=int(place[1]),
        expected_m=float(moved[BAND_Z.size // 2]),
        lowest_m=float(moved.min()),
        highest_m=float(moved.max()),
        expected_taps=action.cost,
        overshoot_probability=action.overshoot,
        position_m=float(place[0]),
    )
