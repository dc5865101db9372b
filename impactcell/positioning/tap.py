"""What a planner answers with: a tap, or the reason why there is none."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Tap:
    """One tap to command.

    Attributes
    ----------
    velocity_m_s : float
    stroke_m : float
        Travel from first contact; inf in a cell without a commanded stroke.
    direction : int
        +1 or -1.
    expected_m, lowest_m, highest_m : float
        Median displacement along the tap, and the band that holds 99.9 % of them.
    expected_taps : float
        Taps still needed, this one included.
    overshoot_probability : float
        That this tap or one of those to come overshoots.
    position_m : float
        Where the part lies before it, along +1.
    """

    velocity_m_s: float
    stroke_m: float
    direction: int = 1
    expected_m: float = math.nan
    lowest_m: float = -math.inf
    highest_m: float = math.inf
    expected_taps: float = math.nan
    overshoot_probability: float = math.nan
    position_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Unreachable:
    """No tap brings the part inside the tolerance within the bound on overshoot."""

    reason: str
