"""Force of a machine, recorded late or early: over each step of a simulation, and about each sample."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.records import Samples


class Drive(NamedTuple):
    """Force over a stretch of a record.

    Attributes
    ----------
    values : ndarray, shape (n,)
        At each sample; of a command, its mean until the next one.
    over : callable
        `over(parts, gain, offset)`: gain F + offset over so many equal parts of the time from each sample to
        the next, shape (n, parts).
    """

    values: Samples
    over: Callable[[int, float, float], Samples]


def drive_of(record: UniformRecord, stretch: slice, delay_s: float, every: int = 1) -> Drive:
    """Drive of a stretch, where the force was recorded `delay_s` late.

    A command acts from its sample to the next; what was measured goes from one to the next in a line, at
    every so many samples.
    """
    time_s = record.time_s[stretch] + delay_s
    if record.command is not None:
        return _held(record, record.command, time_s)
    force = np.interp(time_s, record.time_s, record.force)
    return _in_lines(force if every == 1 else uniform_filter1d(force, every, mode="nearest")[::every])


def force_about(record: UniformRecord, delay_s: float) -> Samples:
    """Force about each sample, where it was recorded `delay_s` late, shape (n,).

    Of a command it is the mean with the hat of a second difference, from one sample before to one after: what
    it adds to the second difference of a position.
    """
    if record.command is None:
        return np.interp(record.time_s + delay_s, record.time_s, record.force) if delay_s else record.force
    whole = math.floor(delay_s / record.step_s)
    share = delay_s / record.step_s - whole
    place = np.arange(len(record.command)) + whole
    before, here, after = (record.command[np.clip(place + shift, 0, len(place) - 1)] for shift in (-1, 0, 1))
    first, last = 0.5 * (1.0 - share) ** 2, 0.5 * share**2
    mean: Samples = first * before + (1.0 - first - last) * here + last * after
    return mean


def _in_lines(force: Samples) -> Drive:
    def over(parts: int, gain: float, offset: float) -> Samples:
        acting = (force * gain + offset)[:, None]
        share = (np.arange(parts) + 0.5) / parts
        force_at: Samples = (1.0 - share) * acting + share * np.concatenate([acting[1:], acting[-1:]])
        return force_at

    return Drive(force, over)


def _held(record: UniformRecord, command: Samples, begin_s: Samples) -> Drive:
    """Mean command over each part: what its impulse grows by."""
    edges = np.append(record.time_s, record.time_s[-1] + record.step_s)
    impulse = np.concatenate([[0.0], np.cumsum(command * record.step_s)])

    def impulse_at(time_s: Samples) -> Samples:
        """Take the command before the first and after the last sample for theirs."""
        before, after = np.minimum(time_s - edges[0], 0.0), np.maximum(time_s - edges[-1], 0.0)
        grown: Samples = np.interp(time_s, edges, impulse) + before * command[0] + after * command[-1]
        return grown

    def over(parts: int, gain: float, offset: float) -> Samples:
        at = begin_s[:, None] + record.step_s * np.arange(parts + 1) / parts
        return gain * np.diff(impulse_at(at), axis=1) * (parts / record.step_s) + offset

    return Drive(over(1, 1.0, 0.0)[:, 0], over)
