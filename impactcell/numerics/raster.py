"""The raster on which rounded values lie: an integer code's step, or the last decimal that was written."""

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
