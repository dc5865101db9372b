"""Blocks of a driven record: from where the part is fastest to where it is fastest again.

A block is to be followed from a state that two numbers describe well, its position and its speed, and what a
driven part does at rest depends on how it got there. So a record is cut where the part moves fastest: every
stop, stick and breakaway lies inside a block.
"""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np

from impactcell.features import white_noise_std
from impactcell.records import Capture, Channel, Samples

MAX_BLOCKS = 60
"""Blocks in all: each has a few numbers of its own, and more of them make a run longer, not better."""
MIN_BLOCK_SAMPLES = 40
"""Samples of a block."""
BLOCK_CORRELATION_TIMES = 2.0
"""Shortest block, in correlation times of the velocity: two are nearly independent."""
CUT_SPEED_SHARE = 0.25
"""A cut needs this share of the record's RMS speed."""
VELOCITY_NOISE_SHARE = 0.02
"""Noise of a speed, over the RMS speed."""


def cut_blocks(captures: tuple[Capture, ...]) -> tuple[tuple[Capture, int], ...]:
    """Blocks of all records, each with the place of its record, from 1; at most `MAX_BLOCKS`, evenly chosen.

    A block's times count from its start, its positions from where the record began; `start_m` says where on
    the table it begins.
    """
    cut = [
        (block, place)
        for place, capture in enumerate(captures, 1)
        if capture.position is not None and capture.force is not None
        for block in _blocks_of_record(capture, capture.position, capture.force)
    ]
    if len(cut) > MAX_BLOCKS:
        cut = [cut[i] for i in np.unique(np.linspace(0, len(cut) - 1, MAX_BLOCKS).astype(int))]
    return tuple((replace(block, cycle=number), place) for number, (block, place) in enumerate(cut, 1))


def _blocks_of_record(capture: Capture, position: Channel, force: Channel) -> list[Capture]:
    speed = smoothed_velocity(position.time_s, position.values)
    out = []
    for first, last in pairwise(_cut_samples(position.time_s, speed)):
        inside = slice(first, last + 1)
        times = position.time_s[inside]
        # One sample of force either side, so that the drive covers the block.
        low = max(int(np.searchsorted(force.time_s, times[0], "right")) - 1, 0)
        high = min(int(np.searchsorted(force.time_s, times[-1], "left")) + 1, len(force.time_s))
        if high - low < MIN_BLOCK_SAMPLES // 2:
            continue
        covariates = {**capture.covariates, "time": float(times[0]), "initial_speed": float(speed[first])}
        out.append(
            replace(
                capture,
                position=replace(position, time_s=times - times[0], values=position.values[inside]),
                force=replace(force, time_s=force.time_s[low:high] - times[0], values=force.values[low:high]),
                start_m=capture.start_m + float(position.values[first]),
                covariates=covariates,
            )
        )
    return out


def _cut_samples(time: Samples, speed: Samples) -> list[int]:
    """Find the samples at which the part is fastest, more than the correlation time of its velocity apart."""
    fast = CUT_SPEED_SHARE * float(np.sqrt(np.mean(speed**2)))
    shortest_s = max(
        BLOCK_CORRELATION_TIMES * _correlation_time(time, speed),
        MIN_BLOCK_SAMPLES * float(np.median(np.diff(time))),
    )
    cuts: list[int] = []
    begin_s = 0.0
    reach_s = shortest_s
    while True:
        low, high = np.searchsorted(time, [time[0] + begin_s, time[0] + begin_s + reach_s])
        if high > len(time) - 1 and cuts:
            return cuts
        fastest = int(low) + int(np.argmax(np.abs(speed[low:high]))) if high > low else 0
        if high > low and abs(speed[fastest]) >= fast:
            cuts.append(fastest)
            begin_s, reach_s = float(time[fastest] - time[0]) + shortest_s, shortest_s
        elif high > len(time) - 1:
            return cuts
        else:
            reach_s *= 1.5


def smoothed_velocity(time: Samples, position: Samples) -> Samples:
    """Velocity along +1 by a straight line through as many samples as make it steady, shape (n,)."""
    step = float(np.median(np.diff(time)))
    noise = white_noise_std(position)
    half = 1
    while True:
        lever = np.arange(-half, half + 1.0)
        weight = lever / (lever @ lever)
        padded = np.concatenate(
            [
                2.0 * position[0] - position[half:0:-1],
                position,
                2.0 * position[-1] - position[-2 : -half - 2 : -1],
            ]
        )
        speed: Samples = np.convolve(padded, weight[::-1], "valid") / step
        scatter = noise / (step * math.sqrt(float(lever @ lever)))
        if scatter <= VELOCITY_NOISE_SHARE * float(np.sqrt(np.mean(speed**2))) or 16 * half > len(position):
            return speed
        half *= 2


def _correlation_time(time: Samples, speed: Samples) -> float:
    """Time after which the velocity's correlation has fallen to 1/e."""
    centred = speed - speed.mean()
    power = np.abs(np.fft.rfft(centred, 2 * len(centred))) ** 2
    correlation = np.fft.irfft(power)[: len(centred)]
    if correlation[0] <= 0.0:
        return 0.0
    below = np.flatnonzero(correlation < correlation[0] / math.e)
    return float(below[0] if len(below) else len(centred)) * float(np.median(np.diff(time)))
