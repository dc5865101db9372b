"""Values of a channel made fit for a regression: spikes are replaced, and a held force is averaged."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_opening, median_filter, percentile_filter

from impactcell.records import Samples

LARGEST = 0.995
"""Share of the samples below what counts as the largest: one faulty sample does not set a range [1]."""
SPIKE_WINDOW = 9
"""Samples of the running median that a spike is held against."""
SPIKE_FACTOR = 8.0
"""A spike differs from the running median this many times more than 95 % of the samples do [1]."""
MIN_SPIKE_SHARE = 0.05
"""And by at least this share of the running median's range [1]."""
NEARBY = 51
"""Samples about a spike, three quarters of which tell how rough it is there: a force rings and rests."""
CONTINUED_BY, MIN_OFF_SHARE = 4, 0.5
"""Sound samples nearest to a spike that are continued to it, and the share of its distance from the running
median by which it is off that: a motion with seven samples in a period is off by less [1]."""
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
    values, outliers = without_outliers(position)
    values, spikes = without_spikes(values)
    return values, outliers + spikes


def without_spikes(values: Samples) -> tuple[Samples, int]:
    """Replace one or two samples far from the running median, and from what their neighbours continue to."""
    if len(values) < SPIKE_WINDOW:
        return values, 0
    reach = SPIKE_WINDOW // 2
    middle = median_filter(_extended(values, reach), SPIKE_WINDOW)[reach:-reach]
    distance = np.abs(values - middle)
    usual = float(np.quantile(distance, 0.95))
    least = max(SPIKE_FACTOR * usual, MIN_SPIKE_SHARE * float(np.ptp(middle)), np.finfo(float).tiny)
    far = distance > least
    # What stays away for longer is a motion or a push: a structure wider than a spike opens none of it.
    apart = far & ~binary_opening(far, np.ones(MAX_SPIKE_SAMPLES + 1, dtype=bool))
    rough = SPIKE_FACTOR * percentile_filter(np.abs(_roughness(values)), 75.0, NEARBY, mode="mirror")
    replaced, sound = values.copy(), np.flatnonzero(~apart)
    for place in np.flatnonzero(apart):
        near = sound[np.argsort(np.abs(sound - place), kind="stable")[:CONTINUED_BY]]
        continued, closely = (np.polyfit(near - place, values[near], degree)[-1] for degree in (2, 3))
        share = MIN_OFF_SHARE * distance[place]
        is_off = abs(values[place] - continued) > max(share, least, rough[place])
        if is_off and abs(values[place] - closely) > share:
            replaced[place] = continued
    return replaced, int(np.count_nonzero(replaced != values))


def _extended(values: Samples, reach: int) -> Samples:
    """Continue values at both ends by lines through those near them, which no faulty one or two turn."""

    def beyond(near: Samples) -> Samples:
        slope = np.median(np.diff(near))
        level = np.median(near - slope * np.arange(len(near)))
        line: Samples = level - slope * np.arange(reach, 0, -1)
        return line

    begin, end = beyond(values[:SPIKE_WINDOW]), beyond(values[: -SPIKE_WINDOW - 1 : -1])[::-1]
    return np.concatenate([begin, values, end])


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
        for faulty in _may_be_faulty(place, len(values)):
            filled = _filled(near, faulty - first)
            if np.abs(_roughness(filled)).max() <= KINK_LEFT * rough.max():
                values[first : place + ABOUT + 1] = filled
                replaced += len(faulty)
                break
    return values, replaced


def _may_be_faulty(place: int, size: int) -> list[NDArray[np.int64]]:
    """Give samples, one or two, that make one rough: of the ends, whose roughness is not known, but one."""
    others = [place + shift for shift in (1, -1, 2, -2, 3, -3)]
    ends = [[other] for other in others if not 2 <= other < size - 2 and abs(other - place) <= 2]
    pairs = [sorted((place, other)) for other in others if 2 <= other < size - 2]
    return [np.array(faulty) for faulty in [*ends, [place], *pairs]]


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
