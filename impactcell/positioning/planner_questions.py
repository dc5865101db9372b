"""What a planner is asked and told, held against what a cell can have: whoever mistakes a unit is told so."""

import math

from impactcell.errors import PositioningError
from impactcell.positioning.tap import Tap

FURTHEST_M = 10.0
"""Further from the origin of its axis, or from its target, no part of a cell lies: mm have been given."""
MOST_DAMPED = 4.0
"""Damping over critical damping of a contact up to which taps are foretold: beyond it a part hardly springs
back, and the closed form is off by more than a tenth."""


def is_number(value: object) -> bool:
    """Whether it is a finite number.

    >>> is_number(0.1), is_number("0.1"), is_number(None), is_number(math.inf)
    (True, False, False, False)
    """
    try:
        return math.isfinite(value)  # type: ignore[arg-type]
    except (TypeError, OverflowError):
        return False


def is_positive(value: object) -> bool:
    """Whether it is a finite number above 0."""
    return is_number(value) and value > 0.0  # type: ignore[operator]


def check_question(
    remaining_m: float, mass_kg: float, position_m: float, travel_m: tuple[float, float]
) -> None:
    """Refuse a remaining distance, mass or position that no part of a cell has; see `TapPlanner.next_tap`.

    Raises
    ------
    PositioningError
    """
    if not is_number(remaining_m):
        raise PositioningError(f"remaining distance must be a number of metres, not {remaining_m}")
    if not is_positive(mass_kg):
        raise PositioningError(f"mass of the part must be a positive number of kg, not {mass_kg}")
    if not is_number(position_m):
        raise PositioningError(f"position of the part must be a number of metres, not {position_m}")
    low, high = travel_m
    if max(low - position_m, position_m - high) > high - low:
        raise PositioningError(
            f"the part cannot lie at {position_m:g} m, far beyond the travel of {low:g} to {high:g} m; "
            "positions are in metres"
        )
    if abs(position_m) > FURTHEST_M:
        raise PositioningError(f"the part cannot lie at {position_m:g} m; positions are in metres")
    if abs(remaining_m) > FURTHEST_M:
        raise PositioningError(
            f"the part cannot lie {abs(remaining_m):g} m from its target; distances are in metres"
        )


def check_observation(tap: Tap, moved_m: float, mass_kg: float) -> None:
    """Refuse to learn from what is no tap, or from what no part does; see `TapPlanner.observe`.

    Raises
    ------
    PositioningError
    """
    if not isinstance(tap, Tap):
        raise PositioningError(f"cannot learn from {tap!r}: that is no tap")
    if not (is_number(moved_m) and is_positive(mass_kg)):
        raise PositioningError(f"cannot learn from a displacement of {moved_m} m of {mass_kg} kg")
    if not is_positive(tap.velocity_m_s):
        raise PositioningError(
            f"cannot learn from a tap at {tap.velocity_m_s} m/s: its velocity must be positive"
        )
    if not (is_positive(tap.stroke_m) or tap.stroke_m == math.inf):
        raise PositioningError(
            f"cannot learn from a tap with a stroke of {tap.stroke_m} m: its stroke must be positive"
        )
    if tap.direction not in {1, -1}:
        raise PositioningError(f"cannot learn from a tap in direction {tap.direction}: it must be 1 or -1")
    if not (is_number(tap.position_m) and abs(tap.position_m) <= FURTHEST_M):
        raise PositioningError(
            f"cannot learn from a tap at the position {tap.position_m} m: positions are in metres"
        )


def lightest_kg(stiffness: float, damping: float) -> float:
    """Least mass (kg) of a part on which taps are foretold, for a contact of k (N/m) and b + k_v (N s/m)."""
    return (damping / MOST_DAMPED) ** 2 / (4.0 * stiffness)
