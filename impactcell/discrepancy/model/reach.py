"""Which shots a coordinate of a fit can change: those that come to where on the table it acts."""

import numpy as np
from numpy.typing import NDArray

from impactcell.discrepancy.data import POSITION, ShotSet
from impactcell.discrepancy.model.constraints import Constraints
from impactcell.discrepancy.model.parameters import Coordinate
from impactcell.records import Samples

MARGIN = 0.25
"""Share of the width over which a coordinate acts by which a shot may miss it and still count: trial steps of
the integration run ahead of the motion. One piece of a cubic B-spline, which is four wide."""


def shots_reached(
    shots: ShotSet, constraints: Constraints, coordinates: tuple[Coordinate, ...], residual: Samples
) -> NDArray[np.bool_] | None:
    """Shots whose prediction each coordinate can change, shape (p, n); None where each can change all.

    Parameters
    ----------
    residual : ndarray, shape (N,)
        Whitened, of the prediction by which the shots' ways along the table are judged.
    """
    if not constraints.supports or shots.items[0].drive.size:
        return None
    begin, end = constraints.acts_between(coordinates)
    margin = np.where(np.isfinite(end - begin), MARGIN * (end - begin), 0.0)
    # A support that is open to one side is as wide as the others.
    margin = np.maximum(margin, margin.max())
    low, high = _positions(shots, residual)
    reached: NDArray[np.bool_] = (low <= (end + margin)[:, None]) & (high >= (begin - margin)[:, None])
    return reached


def _positions(shots: ShotSet, residual: Samples) -> tuple[Samples, Samples]:
    """Range of predicted positions on the table of every shot [m], shape (n,); infinite where not sampled."""
    predicted = shots.values - shots.unwhiten(residual)
    low, high = np.full(len(shots), -np.inf), np.full(len(shots), np.inf)
    for i, shot in enumerate(shots.items):
        along = predicted[shots.samples_of(i)][shots.channel[shots.samples_of(i)] == POSITION]
        if along.size and shot.times[POSITION][-1] >= _last_time(shot.times):
            low[i] = shot.start_m + min(float(along.min()), 0.0)
            high[i] = shot.start_m + max(float(along.max()), 0.0)
    return low, high


def _last_time(times: tuple[Samples, ...]) -> float:
    """Time up to which all channels were sampled, but for one sampling step [s]."""
    return max(float(channel[-1] - np.diff(channel).max(initial=0.0)) for channel in times if channel.size)
