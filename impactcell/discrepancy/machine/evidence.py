"""What speaks for a term: the fall of the held-out gap with it, and its strength where no gap shows."""

import math
from dataclasses import dataclass

from impactcell.discrepancy.search import MAX_P_VALUE, MIN_CLOSED_SHARE


@dataclass(frozen=True, slots=True, eq=False)
class FallOfGap:
    """Held-out gap with and without a term, 1 = noise floor.

    Attributes
    ----------
    before, after : float
    closed, low, high : float
        Share of the gap above the floor that is closed, and its 95 % interval over blocks.
    p_value : float
    """

    before: float
    after: float
    closed: float
    low: float
    high: float
    p_value: float

    @property
    def is_real(self) -> bool:
        """Whether held-out blocks confirm it."""
        return self.is_real_among(1)

    @property
    def is_hidden(self) -> bool:
        """Whether no gap is open without the term, and held-out blocks want it all the same."""
        return math.isnan(self.closed) and self.p_value <= MAX_P_VALUE

    @property
    def lacks(self) -> str:
        """What it lacks to be confirmed, as a clause; empty where it is."""
        if self.is_real:
            return ""
        if self.p_value > MAX_P_VALUE:
            return f"held-out records do not confirm it (p = {self.p_value:.2g})"
        wanted = f"held-out records want it (p = {self.p_value:.2g})"
        if math.isnan(self.closed):
            return f"{wanted}, but without it they leave no gap that it could close"
        if self.closed < MIN_CLOSED_SHARE:
            return f"{wanted}, but it closes {100.0 * self.closed:.2g} % of their gap, less than counts"
        return (
            f"{wanted}, but not alike: of their gap it closes {100.0 * self.low:.0f} to "
            f"{100.0 * self.high:.0f} % (95 %), which may be nothing"
        )

    def is_real_among(self, tests: int) -> bool:
        """Whether held-out blocks confirm it where so many tests share the error of one (Bonferroni)."""
        return self.low > 0.0 and self.closed >= MIN_CLOSED_SHARE and self.p_value <= MAX_P_VALUE / tests


@dataclass(frozen=True, slots=True)
class ClearStrength:
    """A term whose strength is clear of 0 though the gap is at its floor, and its 95 % interval."""

    name: str
    value: float
    low: float
    high: float
