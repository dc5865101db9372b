"""The free slide inside a capture: from the last loss of contact to just before rest, in few block means."""

import math
from dataclasses import dataclass

import numpy as np

from impactcell.errors import CaptureError
from impactcell.numerics.jit import compiled
from impactcell.records import Channel, Samples

MAX_BLOCKS = 200
"""Block means, about, of a slide: a deceleration of g bends a block by less than its noise."""
REST_MARGIN_M, REST_MARGIN_STD = 2e-6, 4.0
"""What is left out before rest, where the stop is not yet certain: the larger of so many metres and of so
many standard deviations of a sample."""
MIN_SAMPLES = 12
"""Fewest samples of a slide: three for each of place, speed, friction and its slope."""
ORIGIN_BLOCKS = 8
"""Blocks from which distance is counted back to loss of contact: a micrometre is near enough."""


@dataclass(frozen=True, slots=True, eq=False)
class SlideSegment:
    """Block means of one free slide.

    Attributes
    ----------
    time_s : ndarray, shape (n,)
        Since loss of contact, centre of each block.
    distance_m : ndarray, shape (n,)
        Slid since loss of contact, positive along the tap.
    variance : float
        Of every block mean, from the sensor's white noise.
    """

    time_s: Samples
    distance_m: Samples
    variance: float


def extract_segment(
    position: Channel | None, direction: int, separation_s: float | None, sigma: float
) -> SlideSegment:
    """Cut the free slide out of a position record and average it; samples that are no numbers are left out.

    Parameters
    ----------
    position : Channel or None
    direction : int
        Of the tap, +1 or -1.
    separation_s : float or None
        Time of the last loss of contact, s; None where there was none, and the whole record is the slide.
    sigma : float
        Standard deviation of one sample, m.

    Raises
    ------
    CaptureError
        No position, too few samples, nothing finite, or the part did not slide.
    """
    if position is None:
        raise CaptureError("the capture has no position channel")
    time_s = np.ascontiguousarray(position.time_s, dtype=np.float64)
    values = np.ascontiguousarray(position.values, dtype=np.float64)
    first_s = float(time_s[0]) if len(time_s) else 0.0
    start_s = first_s if separation_s is None else separation_s
    finite, usable, size, t, x = _average_slide(time_s, values, float(direction), start_s, sigma)
    if finite < MIN_SAMPLES:
        raise CaptureError(f"the position channel has {finite} usable samples")
    if usable < MIN_SAMPLES:
        raise CaptureError(f"{usable} position samples after loss of contact")
    if size == 0:
        is_constant = position.noise_std is None and np.ptp(values) == 0.0
        raise CaptureError("the position is constant" if is_constant else "the part did not slide")
    return SlideSegment(t, x, sigma**2 / size)


@compiled
def _average_slide(
    time: Samples, values: Samples, direction: float, start: float, noise: float
) -> tuple[int, int, int, Samples, Samples]:
    """Cut out the samples from `start` on to just before rest, and average them in blocks.

    Returns
    -------
    finite, usable : int
        Samples that are numbers, and those of them from `start` on.
    size : int
        Samples a block; 0 where the part did not slide.
    time, distance : ndarray, shape (n,)
        Means of the blocks, time from `start` and distance from there.
    """
    t, x, finite, usable = np.empty(len(values)), np.empty(len(values)), 0, 0
    for k in range(len(values)):
        if math.isfinite(values[k]) and math.isfinite(time[k]):
            finite += 1
            if time[k] >= start:
                t[usable], x[usable] = time[k], values[k] * direction
                usable += 1
    if usable < MIN_SAMPLES or not noise > 0.0:
        return finite, usable, 0, t[:0], x[:0]
    few = max(3, usable // 50)
    # the first sample close to the end, for a later one may fall back by noise; a record that is cut before
    # rest is used up to its end
    last, end = 0, 0.0
    for k in range(usable - few, usable):
        end += x[k] / few
    limit = end - max(REST_MARGIN_M, REST_MARGIN_STD * noise)
    while x[last] < limit:
        last += 1
    if last < MIN_SAMPLES:
        return finite, usable, 0, t[:0], x[:0]
    size = max(1, last // MAX_BLOCKS)
    n = last // size
    for k in range(n):
        first, total, way = k * size, 0.0, 0.0
        for i in range(first, first + size):
            total += t[i] - start
            way += x[i]
        t[k], x[k] = total / size, way / size
    few = min(n, ORIGIN_BLOCKS) - 1
    origin = x[0] - t[0] * (x[few] - x[0]) / (t[few] - t[0])
    return finite, usable, size, t[:n].copy(), x[:n] - origin
