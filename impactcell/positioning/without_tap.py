"""Why there is no tap: what keeps a part from its target, as an operator is told.

`part` and `place` as in `impactcell.positioning.displacement_quantiles.Scenarios`.
"""

import math

from impactcell.positioning.force_needed import force_needed
from impactcell.positioning.lookahead_table import PlannerLimits
from impactcell.positioning.planner_posterior import PlannerPosterior
from impactcell.positioning.tap import Unreachable
from impactcell.records import Samples

MOST_STILL = 10
"""Taps in a row that move nothing, after which the rest of the way is out of reach."""


def too_light(mass_kg: float, lightest_kg: float) -> Unreachable:
    """Of a part whose contact is damped beyond what taps are foretold for."""
    return Unreachable(
        f"a part of {mass_kg:g} kg is too light to plan for: below {lightest_kg:.2g} kg the damping of the "
        "contact keeps it from springing back"
    )


def stuck(distance_m: float, overshoot_probability: float) -> Unreachable:
    """Of a part that too many taps in a row have left where it lies."""
    return Unreachable(
        f"{distance_m * 1e6:.1f} µm remain, {MOST_STILL} taps in a row have moved nothing, and any "
        f"that moves more overshoots with a probability above {overshoot_probability:.2g}"
    )


def unmoved(
    limits: PlannerLimits, posterior: PlannerPosterior, part: Samples, place: Samples, least_m: float = 0.0
) -> Unreachable:
    """Of a part that no tap within the limits moves by more than `least_m`: which of them it is."""
    needed_n = math.inf
    if limits.max_force_n < math.inf:
        needed_n = force_needed(limits, posterior, part, place, least_m)
    if limits.max_force_n < needed_n < math.inf:
        return Unreachable(
            f"no tap within max_force_n, {limits.max_force_n:g} N, moves a part of {part[0]} kg "
            f"at friction {posterior.mu_k:.3f}; the gentlest that does may take {math.ceil(needed_n)} N"
        )
    return Unreachable(
        f"no tap up to {limits.max_velocity_m_s:g} m/s and {limits.max_stroke_m * 1e3:g} mm "
        f"moves a part of {part[0]} kg at friction {posterior.mu_k:.3f}"
    )


def overshooting(
    limits: PlannerLimits, distance_m: float, part: Samples, least: float, room_m: float
) -> Unreachable:
    """Of a part that every tap may bring too far; `least` is the probability of the safest.

    `room_m` is how far away the end of the travel is; inf where it is not near.
    """
    if room_m < math.inf:
        return Unreachable(
            f"{distance_m * 1e6:.1f} µm remain, and every tap for a part of {part[0]:.3g} kg "
            f"overshoots or may pass the end of the travel, {room_m * 1e3:.3f} mm away; set a target "
            "further from it, or a wider tolerance"
        )
    return Unreachable(
        f"{distance_m * 1e6:.1f} µm remain, and every tap for a part of {part[0]:.3g} kg overshoots "
        f"{limits.tolerance_m * 1e6:.3g} µm with a probability above {limits.overshoot_probability:.2g} "
        f"(the safest with {least:.2g})"
    )
