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


def held_mean(times: Samples, values: Samples, at: Samples) -> Samples:
    """Mean force from half a sample before to half a sample after, where each acts until the next one."""
    impulse = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(times))])
    half = 0.5 * (at[1] - at[0])
    low, high = (np.clip(at + sign * half, times[0], times[-1]) for sign in (-1.0, 1.0))
    mean: Samples = (np.interp(high, times, impulse) - np.interp(low, times, impulse)) / (high - low)
    return mean


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
