"""What the cell can strike that further shots would be made in."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CellLimits:
    """What a cell can strike, as far as that is known.

    Attributes
    ----------
    max_velocity_m_s : float
        Fastest tap; inf where nobody says.
    both_ends : bool
        The part can be struck from either end, also where no shot shows it.
    mass_kg : float
        Of the cell's part, where it has one; nan where another may be put there.
    """

    max_velocity_m_s: float = math.inf
    both_ends: bool = False
    mass_kg: float = math.nan
