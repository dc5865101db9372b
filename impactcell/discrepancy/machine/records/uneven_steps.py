"""Values at equal steps of a channel whose own steps are not equal, as of a film that lost frames."""

import numpy as np

from impactcell.features import are_equal_steps
from impactcell.quality import gaps_in_time
from impactcell.records import Samples


def at_equal_steps(times: Samples, values: Samples, at: Samples) -> Samples:
    """Lay a position out at other times: by lines where its steps are equal, else by cubics through four.

    A line misses the middle of a lost sample's two steps h by q'' h²/2: half a degree in a film of a swing.
    Across a gap, where nothing counts, it is a line all the same.

    Examples
    --------
    >>> times = np.array([0.0, 1.0, 2.0, 4.0, 5.0])
    >>> at_equal_steps(times, times**3, np.arange(6.0)).round(9).tolist()
    [0.0, 1.0, 8.0, 27.0, 64.0, 125.0]
    """
    lines: Samples = np.interp(at, times, values)
    if are_equal_steps(times) or len(times) < 4:
        return lines
    after = np.clip(np.searchsorted(times, at), 1, len(times) - 1)
    places = np.clip(after - 2, 0, len(times) - 4)[:, np.newaxis] + np.arange(4)
    near = times[places]
    cubics = np.zeros(at.shape)
    for one in range(4):
        others = np.delete(near, one, axis=1)
        weight = np.prod((at[:, np.newaxis] - others) / (near[:, [one]] - others), axis=1)
        cubics += weight * values[places[:, one]]
    return np.where(np.isin(after - 1, gaps_in_time(times)), lines, cubics)


def values_of_a_sample(times: Samples, at: Samples) -> float:
    """Values at equal steps that one sample makes, in the mean square over samples; 1 at least.

    On a line between two samples noise has two thirds of a sample's variance in the mean, but its values go
    together: m of them, of one sample, add up to m times its error, as if each had sqrt(m) times that by
    itself. Rows average over many, and so count samples beside a lost one for one and a half each.

    Examples
    --------
    >>> values_of_a_sample(np.arange(0.0, 40.0, 2.0), np.arange(39.0))
    2.0
    >>> lost = np.delete(np.arange(400.0), np.arange(10, 400, 10))
    >>> round(values_of_a_sample(lost, np.arange(400.0)), 2)  # (7 + 2 (3/2)²) / 10
    1.15
    """
    steps = np.diff(times)
    if are_equal_steps(times):
        return max(float(np.median(steps)) / float(at[1] - at[0]), 1.0)
    before = np.clip(np.searchsorted(times, at, "right") - 1, 0, len(steps) - 1)
    counted = ~np.isin(before, gaps_in_time(times))
    before, at = before[counted], at[counted]
    share = np.clip((at - times[before]) / steps[before], 0.0, 1.0)
    made = np.bincount(before, 1.0 - share, len(times)) + np.bincount(before + 1, share, len(times))
    return max(float(made @ made) / float(made.sum()), 1.0)
