"""Whether equal samples at the top of a channel were cut off there, or rounded to a coarse raster."""

import numpy as np

from impactcell.numerics.raster import raster_of
from impactcell.records import Samples

STEPS_BELOW = 2.5
"""How far below the top, in steps of the raster, a peak is looked at: its two steps next to the highest."""
ROUNDED_SHARE = 0.5
"""Samples there, with one more at either side, over those of the plateau from which on a peak was rounded.
The highest step of a parabola takes at most the whole of its height q and lasts 2 sqrt(2 q / c); the two
below it then last 0.73 times as long. Cut off by 4 q it is 0.22, by 20 q it is 0.05."""


def is_cut_off(values: Samples, plateau: int) -> bool:
    """Whether a channel with `plateau` samples in a row at its highest value had its peak cut off.

    Examples
    --------
    >>> peak = 10.0 - 1e-3 * np.arange(-100.0, 101.0) ** 2
    >>> is_cut_off(np.round(peak), 45), is_cut_off(np.minimum(peak, 8.0), 89)
    (False, True)
    """
    highest = float(values.max())
    low = highest - STEPS_BELOW * (raster_of(values) or 0.0)
    near = np.count_nonzero((values >= low) & (values < highest))
    return bool(near + 2 < ROUNDED_SHARE * plateau)
