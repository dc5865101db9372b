"""Curves as a screen can show them: smallest and largest value in each of a few hundred columns."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from impactcell.records import Channel, Samples

COLUMNS = 300
"""Columns of a decimated curve: a chart of the page has two or three pixels for each."""


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A curve in columns.

    Attributes
    ----------
    x : ndarray, shape (n,)
        Middle of each column.
    low, high : ndarray, shape (n,)
        Smallest and largest value in it.
    """

    x: Samples
    low: Samples
    high: Samples


def decimate(channel: Channel, columns: int = COLUMNS) -> Curve:
    """Give the smallest and largest value in each of at most `columns` columns of equally many samples.

    No peak is lost, however narrow, unlike with every n-th sample.

    >>> import numpy as np
    >>> spike = np.zeros(1000)
    >>> spike[77] = 5.0
    >>> float(decimate(Channel(np.arange(1000.0), spike), 10).high.max())
    5.0
    """
    count = len(channel.values)
    if count <= columns:
        return Curve(channel.time_s, channel.values, channel.values)
    edges, last = _column_edges(count, columns)
    middle = 0.5 * (channel.time_s[edges] + channel.time_s[last])
    low, high = np.minimum.reduceat(channel.values, edges), np.maximum.reduceat(channel.values, edges)
    return Curve(middle, low, high)


@lru_cache(maxsize=16)
def _column_edges(count: int, columns: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Give the first and the last sample of each column; captures of a cell have mostly the same length."""
    edges = np.linspace(0, count, columns + 1).astype(np.intp)
    return edges[:-1], edges[1:] - 1


def envelope(curves: Sequence[Curve], x: Samples) -> Curve | None:
    """Give the band at `x` in which several curves lie, all of them; None of no curve.

    Where most have ended, or have no value, there is no band: the few that go on are not what is usual.
    """
    if not curves:
        return None
    lows = np.stack([_at(curve.x, curve.low, x) for curve in curves])
    highs = np.stack([_at(curve.x, curve.high, x) for curve in curves])
    is_usual = 2 * np.count_nonzero(np.isfinite(lows), axis=0) > len(curves)
    low, high = np.fmin.reduce(lows), np.fmax.reduce(highs)
    return Curve(x, np.where(is_usual, low, np.nan), np.where(is_usual, high, np.nan))


def _at(known_x: Samples, values: Samples, x: Samples) -> Samples:
    return np.interp(x, known_x, values, left=np.nan, right=np.nan)
