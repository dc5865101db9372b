"""The raster on which rounded values lie: an integer code's step, or the last decimal that was written."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from impactcell.errors import RasterError

NEARLY_EQUAL = 1e-9
"""Difference over the largest value below which two values are one, written or computed in two ways."""
SMALL_STEPS = 10.0
"""Steps of the raster up to which neighbouring values tell how wide it is: wider ones are off by rounding."""
MAX_OFF = 0.2
"""Share of a step by which a difference may miss the raster: a code that was scaled and rounded once more."""
FEWEST_STEPS = 3
"""Differences of neighbouring values from which on a raster shows."""


@dataclass(frozen=True, slots=True)
class Raster:
    """Values that are whole steps apart, from `first` to `last`; `Raster()`, without a step: any value.

    Raises
    ------
    RasterError
        For a step that is not above 0, a first value below 0 or a last one below the first, and for what is
        no number; for first or last without a step, which would say nothing.

    Examples
    --------
    >>> Raster(1e-3, 0.5, 0.1)
    Traceback (most recent call last):
    impactcell.errors.RasterError: a raster that begins with 0.5 cannot end with 0.1
    """

    step: float = 0.0
    first: float = 0.0
    last: float = math.inf

    def __post_init__(self) -> None:
        """Refuse what has no values."""
        if (self.step, self.first, self.last) == (0.0, 0.0, math.inf):
            return
        if not (_is_real(self.step) and 0.0 < self.step < math.inf):
            raise RasterError(
                f"a raster has a step above 0, not {self.step!r}; where any value will do it is Raster()"
            )
        if not (_is_real(self.first) and 0.0 <= self.first < math.inf):
            raise RasterError(f"a raster begins with a number of 0 or more, not {self.first!r}")
        if not (_is_real(self.last) and not math.isnan(self.last)):
            raise RasterError(f"a raster ends with a number, or inf where it has no end, not {self.last!r}")
        if self.last < self.first:
            raise RasterError(f"a raster that begins with {self.first:g} cannot end with {self.last:g}")

    @property
    def least(self) -> float:
        """Smallest value above 0; 0 where any will do."""
        return self.first or self.step

    def has_up_to(self, limit: float) -> bool:
        """Whether a value above 0 is at most this limit.

        >>> Raster(0.2, 0.2).has_up_to(0.1), Raster(0.1, 0.1).has_up_to(0.1)
        (False, True)
        """
        reached = self.at_most(np.array([limit]))
        return bool(reached.size) and bool(reached[-1] > 0.0)

    def at_most(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give the largest of the raster that is at most each of some rising values, without those below all.

        Where all of them are, there is none. What is given is never above what was asked for.

        Examples
        --------
        >>> Raster(0.5, 1.0, 3.0).at_most(np.array([0.9, 1.2, 1.4, 2.6, 9.0])).tolist()
        [1.0, 2.5, 3.0]
        >>> Raster(0.5, 1.0, 3.0).at_most(np.array([0.9])).tolist()
        []
        """
        if not self.step:
            return values
        steps = np.floor((np.minimum(values, self.last) - self.first) / self.step + NEARLY_EQUAL)
        _, once = np.unique(steps, return_index=True)
        reached: NDArray[np.float64] = np.minimum(self.first + self.step * steps, values)[once][
            steps[once] >= 0.0
        ]
        return reached


def _is_real(value: object) -> bool:
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


ANY_VALUE: Final = Raster()


def raster_of(values: NDArray[np.float64]) -> float | None:
    """Give the step of the raster on which all values lie; None where they lie on none.

    Examples
    --------
    >>> raster_of(np.array([3.0, 1.5, 4.5, 2.0, 2.5])), raster_of(np.sqrt(np.arange(9.0)))
    (0.5, None)
    """
    distinct = np.unique(values[np.isfinite(values)])
    if not distinct.size:
        return None
    steps = np.diff(distinct)
    steps = steps[steps > NEARLY_EQUAL * float(np.abs(distinct).max())]
    if len(steps) < FEWEST_STEPS:
        return None
    step = float(np.median(steps[steps < 1.5 * steps.min()]))
    small = steps[steps < SMALL_STEPS * step]
    step = float(small.sum() / np.rint(small / step).sum())
    counts = steps / step
    return step if float(np.abs(counts - np.rint(counts)).max()) < MAX_OFF else None


def step_of(values: NDArray[np.float64], stated: float | None) -> float:
    """Give the step of the raster on which values lie, as it is stated or shows in them; 0 where on none."""
    return stated or raster_of(values) or 0.0
