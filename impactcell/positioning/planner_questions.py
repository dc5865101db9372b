"""What a planner is asked and told, held against what a cell can have: whoever mistakes a unit is told so."""

import math

import numpy as np

from impactcell.errors import PositioningError
from impactcell.positioning.planner_posterior import PlannerPosterior
from impactcell.positioning.tap import Tap
from impactcell.records import MM_PER_MIN, Signature
from impactcell.records.plausible_range import meant_in

FURTHEST_M = 10.0
"""Further from the origin of its axis no part of a cell lies: mm have been given."""
LONGEST_WAY_M = 1.0
"""From there on nobody sends a part by taps where no travel is stated: mm have been given. Our choice; it
would take a hundred of the longest taps."""
USUAL_WAY_M = 0.2
"""Up to there parts are sent, to tell in which unit a distance may have been said."""
FASTEST_M_S = 1.0
"""Faster no cell taps whose own limit is not above it: mm/s or mm/min have been given. Our choice."""
FURTHER = 20.0
"""Times what a part slides at the speed of its actuator, v²/(2 mu_k g), beside the stroke: beyond it no tap
moves one. The springiest contact gives it four times as much."""
FURTHER_PUSHED = 2.0
"""Times the stroke that a part may seem to have been pushed: stroke and scale of a sensor may be off, and 8 %
of scatter of a displacement are within what a planner is to learn from."""
LONGEST_M = 0.1
"""In place of the stroke where the actuator halts at loss of contact: how far a part may be pushed before."""
BACK_M = 1e-4
"""By more than that no reading of a part that moved nothing lies behind where it was."""
LARGEST_FRICTION = 10.0
"""No dry pair of materials comes near."""
NOISIEST_M = 1e-3
"""Standard deviation of a displacement beyond which nobody places parts: µm or mm have been given."""
ROUNDED = 1e-6
"""Relative difference that rounding makes: more than that of a register with 32 bits."""
MOST_DAMPED = 4.0
"""Damping over critical damping of a contact up to which taps are foretold: beyond it a part hardly springs
back, and the closed form is off by more than a tenth."""


def is_number(value: object) -> bool:
    """Whether it is a finite number; True and False are none.

    >>> is_number(0.1), is_number("0.1"), is_number(None), is_number(math.inf), is_number(True)
    (True, False, False, False, False)
    """
    if isinstance(value, bool | np.bool_):
        return False
    try:
        return math.isfinite(value)  # type: ignore[arg-type]
    except (TypeError, OverflowError):
        return False


def is_positive(value: object) -> bool:
    """Whether it is a finite number above 0."""
    return is_number(value) and value > 0.0  # type: ignore[operator]


def shown(value: object) -> str:
    """Show what was given: a text with its quotes."""
    return repr(value) if isinstance(value, str) else str(value)


def check_question(
    remaining_m: float, mass_kg: float, position_m: float, travel_m: tuple[float, float]
) -> None:
    """Refuse a remaining distance, mass or position that no part of a cell has; see `TapPlanner.next_tap`.

    Raises
    ------
    PositioningError
    """
    if not is_number(remaining_m):
        raise PositioningError(f"remaining distance must be a number of metres, not {shown(remaining_m)}")
    check_mass(mass_kg)
    if not is_number(position_m):
        raise PositioningError(f"position of the part must be a number of metres, not {shown(position_m)}")
    low, high = travel_m
    if max(low - position_m, position_m - high) > high - low:
        raise PositioningError(
            f"the part cannot lie at {position_m:g} m, far beyond the travel of {low:g} to {high:g} m; "
            "positions are in metres"
        )
    if abs(position_m) > FURTHEST_M:
        raise PositioningError(f"the part cannot lie at {position_m:g} m; positions are in metres")
    target_m, length_m = position_m + remaining_m, high - low
    if max(low - target_m, target_m - high) > length_m or (
        math.isinf(length_m) and abs(remaining_m) >= LONGEST_WAY_M
    ):
        way_out = meant_in(abs(remaining_m), {"mm": 1e-3, "µm": 1e-6}, (1e-5, min(length_m, USUAL_WAY_M)))
        raise PositioningError(
            f"the part cannot lie {abs(remaining_m):g} m from its target; distances are in metres"
            + (way_out and f": {way_out}")
        )


def check_observation(tap: Tap, moved_m: float, mass_kg: float, slowing_m_s2: float) -> None:
    """Refuse to learn from what no part does; see `TapPlanner.observe`.

    `slowing_m_s2` is about what friction slows the part by.

    Raises
    ------
    PositioningError
    """
    if not (is_number(moved_m) and is_positive(mass_kg)):
        raise PositioningError(
            f"cannot learn from a displacement of {shown(moved_m)} m of {shown(mass_kg)} kg"
        )
    if moved_m < -BACK_M:
        raise PositioningError(
            f"cannot learn from a displacement of {moved_m:g} m: it is positive along the tap; give what the "
            "position has changed by, times the tap's direction, and nothing where a hand has moved the part"
        )
    stroke_m = tap.stroke_m if tap.stroke_m < math.inf else LONGEST_M
    furthest_m = FURTHER * tap.velocity_m_s**2 / (2.0 * slowing_m_s2) + FURTHER_PUSHED * stroke_m
    if moved_m > furthest_m:
        way_out = meant_in(moved_m, {"mm": 1e-3, "µm": 1e-6}, (0.0, furthest_m))
        raise PositioningError(
            f"cannot learn from a displacement of {moved_m:g} m, where no tap at {tap.velocity_m_s:.3g} m/s "
            f"moves a part by more than {furthest_m:.2g} m" + (way_out and f"; {way_out}")
        )


def check_is_made(
    tap: Tap,
    mass_kg: float,
    max_velocity_m_s: float,
    lightest_kg: float,
    two_sided: bool,  # noqa: FBT001
) -> None:
    """Refuse to learn from a tap that no cell like this one makes; see `TapPlanner.observe`.

    Limits may have been lowered since it was planned: what it may not pass are those of cells.

    Raises
    ------
    PositioningError
    """
    check_is_tap(tap)
    fastest = max(max_velocity_m_s, FASTEST_M_S)
    if tap.velocity_m_s > fastest * (1.0 + ROUNDED):
        way_out = meant_in(tap.velocity_m_s, {"mm/min": MM_PER_MIN, "mm/s": 1e-3}, (0.0, fastest))
        raise PositioningError(
            f"cannot learn from a tap at {tap.velocity_m_s:g} m/s, where none is faster than {fastest:g} m/s"
            + (way_out and f"; {way_out}")
        )
    if LONGEST_M * (1.0 + ROUNDED) < tap.stroke_m < math.inf:
        way_out = meant_in(tap.stroke_m, {"mm": 1e-3, "µm": 1e-6}, (0.0, LONGEST_M))
        raise PositioningError(
            f"cannot learn from a tap with a stroke of {tap.stroke_m:g} m, where none is longer than "
            f"{LONGEST_M:g} m" + (way_out and f"; {way_out}")
        )
    if tap.direction < 0 and not two_sided:
        raise PositioningError(
            "cannot learn from a tap in direction -1: this cell strikes from one side only; with actuators "
            "on both ends, give two_sided=True"
        )
    if is_positive(mass_kg) and mass_kg < lightest_kg:
        raise PositioningError(
            f"cannot learn from a tap at {mass_kg:g} kg: below {lightest_kg:.2g} kg the damping of the "
            "contact keeps a part from springing back; masses are in kg"
        )


def check_friction(mu_k: float, std: float) -> None:
    """Refuse what is no kinetic coefficient with its deviation; see `TapPlanner.observe_friction`.

    Raises
    ------
    PositioningError
    """
    if not (is_positive(mu_k) and is_number(std) and std >= 0.0):
        raise PositioningError(
            f"cannot use a friction of {shown(mu_k)} with a standard deviation of {shown(std)}: the one is a "
            "number above 0, the other one of 0 or more"
        )
    if std > LARGEST_FRICTION:
        raise PositioningError(
            f"cannot use a friction with a standard deviation of {std:g}: no surface has so much; leave out "
            "what is not known"
        )
    if mu_k > LARGEST_FRICTION:
        raise PositioningError(
            f"cannot use a friction of {mu_k:g}: no surface has it; if that was meant in %, "
            f"give {0.01 * mu_k:g}"
        )


def check_posterior(posterior: PlannerPosterior) -> None:
    """Refuse what is no posterior; see `TapPlanner.resume`.

    Raises
    ------
    PositioningError
    """
    if not isinstance(posterior, PlannerPosterior):
        raise PositioningError(f"tap planner: resume takes what `posterior` gave, not {posterior!r}")


def check_signature(signature: Signature) -> None:
    """Refuse what is no signature; see `TapPlanner.observe_signature`.

    Raises
    ------
    PositioningError
    """
    if not isinstance(signature, Signature):
        raise PositioningError(f"cannot learn from {signature!r}: that is no signature")


def check_mass(mass_kg: float) -> None:
    """Refuse what is no mass.

    Raises
    ------
    PositioningError
    """
    if not is_positive(mass_kg):
        raise PositioningError(f"mass of the part must be a positive number of kg, not {shown(mass_kg)}")


def check_is_tap(tap: Tap) -> None:
    """Refuse what is no tap, or one that no cell makes.

    Raises
    ------
    PositioningError
    """
    if not isinstance(tap, Tap):
        raise PositioningError(f"cannot use {tap!r}: that is no tap")
    if not is_positive(tap.velocity_m_s):
        raise PositioningError(
            f"cannot use a tap at {shown(tap.velocity_m_s)} m/s: its velocity must be positive"
        )
    if not (is_positive(tap.stroke_m) or tap.stroke_m == math.inf):
        raise PositioningError(
            f"cannot use a tap with a stroke of {shown(tap.stroke_m)} m: its stroke must be positive"
        )
    if tap.direction not in {1, -1}:
        raise PositioningError(f"cannot use a tap in direction {shown(tap.direction)}: it must be 1 or -1")
    if not (is_number(tap.position_m) and abs(tap.position_m) <= FURTHEST_M):
        raise PositioningError(
            f"cannot use a tap at the position {shown(tap.position_m)} m: positions are in metres"
        )


def check_sensor(position_noise_m: float) -> None:
    """Refuse a sensor that no cell has; see `TapPlanner`.

    Raises
    ------
    PositioningError
    """
    if not (is_positive(position_noise_m) and position_noise_m <= NOISIEST_M):
        raise PositioningError(
            f"tap planner: position_noise_m lies between 0 and {NOISIEST_M:g} m, not "
            f"{shown(position_noise_m)}; it is in metres"
        )


def lightest_kg(stiffness: float, damping: float) -> float:
    """Least mass (kg) of a part on which taps are foretold, for a contact of k (N/m) and b + k_v (N s/m)."""
    return (damping / MOST_DAMPED) ** 2 / (4.0 * stiffness)
