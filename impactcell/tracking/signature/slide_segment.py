"""The free slide inside a capture: from the last loss of contact to just before rest, in few block means."""

import math
from dataclasses import dataclass

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import Capture, Channel, Samples

MAX_BLOCKS = (
    200  # a slide is averaged down to about so many block means; a ~ g curves a block by less than its noise
)
REST_MARGIN_M = 2e-6  # the last micrometres before rest are left out: there the stop is not yet certain
MIN_SAMPLES = 12


class NoSlideError(ValueError):
    """A capture without a usable free slide; the message says why."""


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


def extract_segment(capture: Capture, separation_s: float | None = None) -> SlideSegment:
    """Cut the free slide out of a capture.

    Parameters
    ----------
    separation_s : float or None
        Last loss of contact; None finds it in the force channel, or takes the whole record without one.

    Raises
    ------
    NoSlideError
        No position, too few samples, nothing finite, or the part did not slide.
    """
    channel = capture.position
    if channel is None:
        raise NoSlideError("the capture has no position channel")
    start = _separation(capture) if separation_s is None else separation_s
    time, position = _contiguous(channel)
    noise = channel.noise_std or _noise(time, position, start)
    finite, usable, size, t, x = _average_slide(time, position, float(capture.direction), start, noise)
    if finite < MIN_SAMPLES:
        raise NoSlideError(f"the position channel has {finite} usable samples")
    if usable < MIN_SAMPLES:
        raise NoSlideError(f"{usable} position samples after loss of contact")
    if not noise > 0.0:
        raise NoSlideError("the position is constant")
    if size == 0:
        raise NoSlideError("the part did not slide")
    return SlideSegment(t, x, noise**2 / size)


def _contiguous(channel: Channel) -> tuple[Samples, Samples]:
    """Give compiled code the one layout it is compiled for."""
    return (
        np.ascontiguousarray(channel.time_s, dtype=np.float64),
        np.ascontiguousarray(channel.values, dtype=np.float64),
    )


def _separation(capture: Capture) -> float:
    """Time of the last contact as the force channel shows it; its first sample without one."""
    force = capture.force
    if force is None or len(force.values) == 0:
        times = None if capture.position is None else capture.position.time_s
        return 0.0 if times is None or len(times) == 0 else float(times[0])
    time, values = _contiguous(force)
    return _last_contact(time, values, force.noise_std or 0.0)


@compiled
def _last_contact(time: Samples, values: Samples, noise: float) -> float:
    """Time just after the last sample at which the force is not noise; the first without any."""
    n = len(values)
    largest, few = 0.0, min(max(3, n // 10), n)
    for value in values:
        if math.isfinite(value) and value > largest:
            largest = value
    if noise <= 0.0:
        total, square = 0.0, 0.0
        for value in values[n - few :]:
            total += value if math.isfinite(value) else 0.0
        for value in values[n - few :]:
            square += ((value if math.isfinite(value) else 0.0) - total / few) ** 2
        noise = math.sqrt(square / few)
    limit = max(5.0 * noise, 0.01 * largest)
    for k in range(n - 1, -1, -1):
        if math.isfinite(values[k]) and values[k] > limit:
            return float(time[min(k + 2, n - 1)])
    return float(time[0])


def _noise(time: Samples, values: Samples, start: float) -> float:
    """Find the standard deviation of white noise from third differences, which the motion hardly moves."""
    usable = np.isfinite(values) & np.isfinite(time) & (time >= start)
    if np.count_nonzero(usable) < MIN_SAMPLES:
        return 0.0
    third = np.diff(values[usable], 3)
    return float(np.median(np.abs(third))) / 0.6745 / math.sqrt(20.0)


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
    limit = end - max(REST_MARGIN_M, 4.0 * noise)
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
    # zero of distance: back along the first blocks to loss of contact; a micrometre is near enough
    few = min(n, 8) - 1
    origin = x[0] - t[0] * (x[few] - x[0]) / (t[few] - t[0])
    return finite, usable, size, t[:n].copy(), x[:n] - origin
