"""The free slide inside a capture: from the last loss of contact to just before rest, in few block means."""

import math
from dataclasses import dataclass

import numpy as np

from impactcell.records import Capture, Samples

BLOCKS = (
    400  # a slide is averaged down to about so many block means; a ~ g curves a block by less than its noise
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
    variance : ndarray, shape (n,)
        Of each block mean, from the sensor's white noise.
    """

    time_s: Samples
    distance_m: Samples
    variance: Samples


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
    good = np.isfinite(channel.values) & np.isfinite(channel.time_s)
    time, position = channel.time_s[good], channel.values[good] * capture.direction
    if len(time) < FEWEST_SAMPLES:
        raise NoSlideError(f"the position channel has {len(time)} usable samples")
    start = _separation(capture) if separation_s is None else separation_s
    time, position = time[time >= start], position[time >= start]
    if len(time) < FEWEST_SAMPLES:
        raise NoSlideError(f"{len(time)} position samples after loss of contact")
    noise = channel.noise_std or _noise(position)
    if not noise > 0.0:
        raise NoSlideError("the position is constant")
    end = float(np.mean(position[-max(3, len(position) // 50) :]))
    # the first sample close to the end, for a later one may fall back by noise; a record that is cut
    # before rest is used up to its end
    last = int(np.argmax(position >= end - max(REST_MARGIN_M, 4.0 * noise)))
    if last < FEWEST_SAMPLES:
        raise NoSlideError("the part did not slide")
    return _blocks(time[:last] - start, position[:last], noise)


def _separation(capture: Capture) -> float:
    """Time of the last contact as the force channel shows it; -inf without a force channel."""
    force = capture.force
    if force is None or len(force.values) == 0:
        return -math.inf if capture.position is None else float(capture.position.time_s[0])
    values = np.where(np.isfinite(force.values), force.values, 0.0)
    noise = force.noise_std or float(np.std(values[-max(3, len(values) // 10) :]))
    touching = np.flatnonzero(values > max(5.0 * noise, 0.01 * float(values.max())))
    if len(touching) == 0:
        return float(force.time_s[0])
    after = min(int(touching[-1]) + 2, len(values) - 1)
    return float(force.time_s[after])


def _noise(position: Samples) -> float:
    """Find the standard deviation of white noise from third differences, which the motion hardly moves."""
    third = np.diff(position, 3)
    return float(np.median(np.abs(third))) / 0.6745 / math.sqrt(20.0)


def _blocks(time: Samples, position: Samples, noise: float) -> Slide:
    size = max(1, len(time) // BLOCKS)
    whole = len(time) // size * size
    t = time[:whole].reshape(-1, size).mean(axis=1)
    x = position[:whole].reshape(-1, size).mean(axis=1)
    # zero of distance: back along the first blocks to loss of contact; a micrometre is near enough
    few = min(len(t), 8) - 1
    origin = x[0] - t[0] * (x[few] - x[0]) / (t[few] - t[0])
    return Slide(t, x - origin, np.full(len(t), noise**2 / size))
