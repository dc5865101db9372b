"""The gap of a model: in the traces, and in the friction factors."""

import enum
import math
from collections.abc import Iterable
from dataclasses import dataclass

from impactcell.discrepancy.search.policy import POLICY


class Part(enum.StrEnum):
    """In what a gap shows; effects between shots show in the friction factors only."""

    TRACES = "traces"
    FACTORS = "friction_factors"


@dataclass(frozen=True, slots=True, eq=False)
class Gap:
    """Gap of one model on one set of shots, in units of the noise floor.

    Attributes
    ----------
    trace : float
        RMS of the trace residuals over the sensors' noise.
    factor : float
        Spread of the friction factors about their law over their replicate spread; nan without replicates.
    """

    trace: float
    factor: float

    def of(self, parts: Iterable[Part]) -> float:
        """Gap in some of its parts: the largest of them."""
        values = [self.trace if part is Part.TRACES else self.factor for part in parts]
        return max((value for value in values if not math.isnan(value)), default=math.nan)

    def is_narrower(self, before: "Gap") -> bool:
        """Whether the factors are narrower than before, and by more than the gap of the traces explains."""
        return narrows(before.factor, self.factor, self.trace)


def narrows(before: float, after: float, trace: float) -> bool:
    """Whether friction factors become narrower by more than a trifle, and by more than model error explains.

    What changes the traces changes the factors a little. And what a model lacks in the traces, left at a gap
    g, makes the factors go with direction, load or time as well: they must become narrower g times.

    Parameters
    ----------
    before, after : float
        Their standard deviation, in whatever unit.
    trace : float
        Gap that is left in the traces [noise floors].
    """
    return after * max(trace, 1.0 / POLICY.max_spread_ratio) <= before
