"""The last gate before the module: velocity, stroke, force and travel of a tap, in one place.

That a tap might go too far is weighed before, by `action_selection`.
"""

import math
from dataclasses import dataclass

import numpy as np

from impactcell.errors import PositioningError
from impactcell.numerics.jit import compiled
from impactcell.positioning.tap import Tap
from impactcell.records import Samples

PLANNED_SHARE = 1.0 - 1e-9
"""Of a limit, up to which taps are planned: rounded another way, one at the limit itself may be above it."""


@dataclass(frozen=True, slots=True)
class SafetyLimits:
    """What a cell allows.

    Attributes
    ----------
    velocity_m_s, stroke_m, force_n : float
        Largest of each.
    travel_m : tuple of float
        Positions between which the part must stay, in order.
    """

    velocity_m_s: float
    stroke_m: float = math.inf
    force_n: float = math.inf
    travel_m: tuple[float, float] = (-math.inf, math.inf)


@compiled
def largest_force(v: float, stroke: float, plant: Samples, mass: float, gravity: float) -> float:
    """Bound on the contact force of a tap (N), from above.

    While the actuator runs, the indentation swings about its static value with an amplitude that what was
    stored at breakaway and the approach speed give it, the damper adds b v at most, and no indentation
    exceeds the stroke::

        F <= min(k stroke, F_k + hypot(F_s - F_k, v sqrt(k m))) + b v,   F_k = mu_k m g + k_v v

    Parameters
    ----------
    plant : ndarray, shape (5,)
        k, b, mu_s, mu_k and k_v, SI.
    """
    k, b, mu_s, mu_k, viscous = plant
    static = mu_s * mass * gravity
    kinetic = mu_k * mass * gravity + viscous * v
    swing = kinetic + math.hypot(max(static - kinetic, 0.0), v * math.sqrt(k * mass))
    return float(min(k * stroke, max(swing, static)) + b * v)


@compiled
def allowed_strokes(
    velocities: Samples, force: float, plant: Samples, mass: float, gravity: float
) -> Samples:
    """Longest stroke (m) at each velocity whose contact force stays within `force` (N); inf without limit."""
    strokes = np.full(velocities.size, np.inf)
    for i in range(velocities.size):
        v = velocities[i]
        if largest_force(v, np.inf, plant, mass, gravity) > force:
            strokes[i] = max((force - plant[1] * v) / plant[0], 0.0) * PLANNED_SHARE
    return strokes


def room_m(travel_m: tuple[float, float], position_m: float, direction: float) -> float:
    """Say how far (m) a part at this position may go in this direction, +1 or -1."""
    low, high = travel_m
    return high - position_m if direction > 0.0 else position_m - low


def check_tap(tap: Tap, limits: SafetyLimits, position_m: float, force_n: float, cell: str = "cell") -> Tap:
    """Return the tap, if the cell allows it.

    Parameters
    ----------
    position_m : float
        Where the part lies, along +1.
    force_n : float
        Bound on the contact force of this tap.

    Raises
    ------
    PositioningError
        Otherwise; nothing has been commanded.
    """
    if not 0.0 < tap.velocity_m_s <= limits.velocity_m_s:
        raise PositioningError(
            f"{cell}: a tap at {tap.velocity_m_s} m/s is not allowed, the limit is {limits.velocity_m_s} m/s"
        )
    if not 0.0 < tap.stroke_m <= limits.stroke_m:
        raise PositioningError(
            f"{cell}: a stroke of {tap.stroke_m * 1e3} mm is not allowed, "
            f"the limit is {limits.stroke_m * 1e3} mm"
        )
    if tap.direction not in {1, -1}:
        raise PositioningError(f"{cell}: direction must be 1 or -1, not {tap.direction}")
    if not force_n <= limits.force_n:
        raise PositioningError(
            f"{cell}: a tap with up to {force_n:.0f} N is not allowed, the limit is {limits.force_n:.0f} N"
        )
    if not tap.highest_m <= room_m(limits.travel_m, position_m, tap.direction):
        low, high = limits.travel_m
        furthest = position_m + tap.direction * tap.highest_m
        raise PositioningError(
            f"{cell}: a tap that may bring the part to {furthest * 1e3:.3f} mm is not allowed, "
            f"its travel is {low * 1e3:g} to {high * 1e3:g} mm"
        )
    return tap
