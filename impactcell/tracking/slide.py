"""The free slide inside a capture: from the last loss of contact to just before rest, in few block means."""

import math
from dataclasses import dataclass

import numpy as np

from impactcell.compiled import compiled
from impactcell.records import Capture, Channel, Samples

BLOCKS = (
    200  # a slide is averaged down to about so many block means; a ~ g curves a block by less than its noise
)
REST_MARGIN_M = 2e-6  # the last micrometres before rest are left out: there the stop is not yet certain
FEWEST_SAMPLES = 12


class NoSlideError(ValueError):
    """A capture without a usable free slide; the message says why."""


@dataclass(frozen=True, slots=True, eq=False)
class Slide:
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


def find_slide(capture: Capture, separation_s: float | None = None) -> Slide:
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
    time, position, usable = _usable(*_contiguous(channel), float(capture.direction), start)
    if usable < FEWEST_SAMPLES:
        raise NoSlideError(f"the position channel has {usable} usable samples")
    if len(time) < FEWEST_SAMPLES:
        raise NoSlideError(f"{len(time)} position samples after loss of contact")
    noise = channel.noise_std or _noise(position)
    if not noise > 0.0:
        raise NoSlideError("the position is constant")
    end = float(np.mean(position[-max(3, len(position) // 50) :]))
    last = _first_beyond(position, end - max(REST_MARGIN_M, 4.0 * noise))
    if last < FEWEST_SAMPLES:
        raise NoSlideError("the part did not slide")
    size = max(1, last // BLOCKS)
    return Slide(*_blocks(time[:last], position[:last], size, start), noise**2 / size)


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
    return _last_touch(time, values, force.noise_std or 0.0)


@compiled
def _last_touch(time: Samples, values: Samples, noise: float) -> float:
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


@compiled
def _usable(time: Samples, values: Samples, direction: float, start: float) -> tuple[Samples, Samples, int]:
    """Finite samples from `start` on, along the tap; and how many are finite at all."""
    n = len(values)
    times, positions = np.empty(n), np.empty(n)
    usable = kept = 0
    for k in range(n):
        if math.isfinite(values[k]) and math.isfinite(time[k]):
            usable += 1
            if time[k] >= start:
                times[kept], positions[kept] = time[k], values[k] * direction
                kept += 1
    return times[:kept], positions[:kept], usable


@compiled
def _first_beyond(position: Samples, limit: float) -> int:
    """Find the first sample close to the end, for a later one may fall back by noise.

    A record that is cut before rest is used up to its end.
    """
    for k in range(len(position)):
        if position[k] >= limit:
            return k
    return 0


def _noise(position: Samples) -> float:
    """Find the standard deviation of white noise from third differences, which the motion hardly moves."""
    third = np.diff(position, 3)
    return float(np.median(np.abs(third))) / 0.6745 / math.sqrt(20.0)


@compiled
def _blocks(time: Samples, position: Samples, size: int, start: float) -> tuple[Samples, Samples]:
    """Means of blocks of `size` samples, time from `start` and distance from there."""
    n = len(time) // size
    t, x = np.zeros(n), np.zeros(n)
    for k in range(n):
        for i in range(k * size, (k + 1) * size):
            t[k] += time[i] - start
            x[k] += position[i]
        t[k] /= size
        x[k] /= size
    # zero of distance: back along the first blocks to loss of contact; a micrometre is near enough
    few = min(n, 8) - 1
    origin = x[0] - t[0] * (x[few] - x[0]) / (t[few] - t[0])
    return t, x - origin
