"""The raster on which rounded values lie: an integer code's step, or the last decimal that was written."""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

NEARLY_EQUAL = 1e-9
"""Difference over the largest value below which two values are one, written or computed in two ways."""
SMALL_STEPS = 10.0
"""Steps of the raster up to which neighbouring values tell how wide it is: wider ones are off by rounding."""
MAX_OFF = 0.2
"""Share of a step by which a difference may miss the raster: a code that was scaled and rounded once more."""
FEWEST_STEPS = 3
"""Differences of neighbouring values from which on a raster shows."""


class Raster(NamedTuple):
    """Values that are whole steps apart, from `first` to `last`; with a step of 0 any value is one."""

    step: float = 0.0
    first: float = 0.0
    last: float = math.inf

    def at_most(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give the largest of the raster that is at most each of some rising values, without those below all.

        Where all of them are, it is the first of the raster. What is given is never above what was asked for.

        Examples
        --------
        >>> Raster(0.5, 1.0, 3.0).at_most(np.array([0.9, 1.2, 1.4, 2.6, 9.0])).tolist()
        [1.0, 2.5, 3.0]
        """
        if not self.step:
            return values
        steps = np.floor((np.minimum(values, self.last) - self.first) / self.step + NEARLY_EQUAL)
        _, once = np.unique(steps, return_index=True)
        reached: NDArray[np.float64] = np.minimum(self.first + self.step * steps, values)[once][
            steps[once] >= 0.0
        ]
        return reached if reached.size else np.array([self.first])


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
