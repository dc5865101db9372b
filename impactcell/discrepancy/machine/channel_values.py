"""Values of a channel made fit for a regression: spikes are replaced, and a held force is averaged."""

import numpy as np
from scipy.ndimage import binary_opening, median_filter

from impactcell.records import Samples

LARGEST = 0.995
"""Share of the samples below what counts as the largest: one faulty sample does not set a range [1]."""
SPIKE_WINDOW = 9
"""Samples of the running median that a spike is held against."""
SPIKE_FACTOR = 8.0
"""A spike differs from the running median this many times more than 95 % of the samples do [1]."""
MIN_SPIKE_SHARE = 0.05
"""And by at least this share of the channel's range [1]."""
MAX_SPIKE_SAMPLES = 2
"""Samples in a row that are a spike, as where data are inspected: the pushes of a controller last longer."""
USUAL_SHARE, USUAL_NOISES = 0.9, 1.645
"""Share of the samples by which a motion's usual roughness is told, and in how many deviations it lies."""
MAX_FAR_SHARE = 0.05
"""Share of rough samples beyond which they are how the motion goes: an outlier makes five [1]."""
ABOUT, FILLED_BY = 6, 8
"""Samples on either side of an outlier that are looked at, and of these those by which it is filled."""
KINK_LEFT = 0.2
"""Share of an outlier's roughness that may be left about it once it is replaced: about a kink more is [1]."""


def held_mean(times: Samples, values: Samples, begin: Samples, end: Samples) -> Samples:
    """Mean force from each begin to each end, where each value acts until the next one, the last as long."""
    edges = np.append(times, 2.0 * times[-1] - times[-2])
    impulse = np.concatenate([[0.0], np.cumsum(values * np.diff(edges))])
    low, high = (np.clip(at, edges[0], edges[-1]) for at in (begin, end))
    mean: Samples = (np.interp(high, edges, impulse) - np.interp(low, edges, impulse)) / (high - low)
    return mean


def cleaned_position(position: Samples) -> tuple[Samples, int]:
    """Replace spikes and outliers of a position; how many were replaced beside it."""
    values, spikes = without_spikes(position)
    values, outliers = without_outliers(values)
    return values, spikes + outliers


def without_spikes(values: Samples) -> tuple[Samples, int]:
    """Replace one or two samples far from the running median by the line between their neighbours."""
    middle = median_filter(values, SPIKE_WINDOW, mode="mirror")
    distance = np.abs(values - middle)
    usual = float(np.quantile(distance, 0.95))
    span = float(np.subtract(*np.quantile(values, [LARGEST, 1.0 - LARGEST])))
    far = distance > max(SPIKE_FACTOR * usual, MIN_SPIKE_SHARE * span, np.finfo(float).tiny)
    # What stays away for longer is a motion or a push: a structure wider than a spike opens none of it.
    spikes = far & ~binary_opening(far, np.ones(MAX_SPIKE_SAMPLES + 1, dtype=bool))
    place = np.arange(len(values))
    return np.interp(place, place[~spikes], values[~spikes]), int(spikes.sum())


def without_outliers(position: Samples) -> tuple[Samples, int]:
    """Replace samples of a smooth motion, one or two close by, that fit no cubic with those about them.

    Where the motion itself has a kink no other value of so few makes its surroundings smooth: all are kept.
    """
    values = position.copy()
    roughness = np.abs(_roughness(values))
    usual = float(np.quantile(roughness, USUAL_SHARE)) / USUAL_NOISES
    far = np.flatnonzero(roughness > SPIKE_FACTOR * usual)
    if not usual or len(far) > MAX_FAR_SHARE * len(values):
        return values, 0
    replaced = 0
    for place in far[np.argsort(-roughness[far])]:
        first = max(place - ABOUT, 0)
        near = values[first : place + ABOUT + 1]
        rough = np.abs(_roughness(near))
        if rough[place - first] <= SPIKE_FACTOR * usual:
            continue
        for other in (0, 1, -1, 2, -2, 3, -3):
            faulty = np.unique(np.clip([place - first, place - first + other], 0, len(near) - 1))
            filled = _filled(near, faulty)
            if np.abs(_roughness(filled)).max() <= KINK_LEFT * rough.max():
                values[first : place + ABOUT + 1] = filled
                replaced += len(faulty)
                break
    return values, replaced


def _filled(values: Samples, faulty: np.ndarray) -> Samples:
    """Replace faulty samples by the cubic through the others nearby."""
    place = np.arange(len(values)) - float(faulty[0])
    sound = np.setdiff1d(np.arange(len(values)), faulty)
    sound = sound[np.argsort(np.abs(place[sound]), kind="stable")[:FILLED_BY]]
    filled = values.copy()
    filled[faulty] = np.polyval(np.polyfit(place[sound], values[sound], 3), place[faulty])
    return filled


def _roughness(values: Samples) -> Samples:
    """Distance of each sample from the cubic through two on either side of it; 0 at the ends."""
    distance = np.zeros(values.shape)
    distance[2:-2] = values[2:-2] - (4.0 * (values[1:-3] + values[3:-1]) - values[:-4] - values[4:]) / 6.0
    return distance
