"""Where a force stands without contact, if not at zero: as after a warm-up, or without a tare."""

import math
from dataclasses import replace

import numpy as np

from impactcell.features.channels import OFFSET_STD, CheckedForce
from impactcell.features.contact import IDLE_PART, MAX_IDLE_SHARE
from impactcell.numerics.local_polynomial import mean
from impactcell.records import Samples

FEWEST = 10
"""Samples without contact by which an offset can be told."""
FLAT_STD, MAX_SCATTER = 4.0, 1.5
"""How far the two halves of them may lie apart, in standard deviations of that, and how much they may scatter
over the noise of a sample: else something moves there, and no one figure is their zero."""


def with_zero(force: CheckedForce) -> tuple[CheckedForce, str]:
    """Take off what a force shows without contact, and say so; the force itself where that is nothing.

    The samples before t = 0 show it, and the last ones of the record; alone, these only as far as a part may
    not lean on the actuator. Hum and drift have no one value there, and stay.
    """
    before = int(np.searchsorted(force.time_s, 0.0, "left"))
    tail = force.values[-max(len(force.values) // IDLE_PART, 1) :]
    levels = [_level(idle, force) for idle in (force.values[: max(before - 1, 0)], tail)]
    if levels[1] is None or (before > FEWEST and levels[0] is None):
        return force, ""
    (after, count), (first, earlier) = levels[1], levels[0] or (0.0, 0)
    after_std, first_std = force.mean_std(count), force.mean_std(earlier) if earlier else 0.0
    if earlier and abs(first - after) > FLAT_STD * math.hypot(first_std, after_std):
        return force, ""
    offset = (after * count + first * earlier) / (count + earlier)
    std = math.hypot(after_std * count, first_std * earlier) / (count + earlier)
    is_small = abs(offset) < MAX_IDLE_SHARE * float(force.smooth.max())
    if not (abs(offset) > OFFSET_STD * std and (is_small or earlier)):
        return force, ""
    low, high = force.full_scale or (-math.inf, math.inf)
    taken_off = replace(
        force,
        values=force.values - offset,
        smooth=force.smooth - offset,
        highest=force.highest - offset,
        full_scale=None if force.full_scale is None else (low - offset, high - offset),
        zero_std=std,
    )
    return taken_off, f"force stands at {offset:.3g} N without contact, taken off: tare its sensor"


def _level(values: Samples, force: CheckedForce) -> tuple[float, int] | None:
    """Mean and number of samples that are noise about one value; None where they are not, or too few."""
    count, half = len(values), len(values) // 2
    if count < FEWEST:
        return None
    apart = abs(mean(values[:half]) - mean(values[half:]))
    if apart > FLAT_STD * force.halves_std(count) or float(values.std()) > MAX_SCATTER * force.sigma:
        return None
    return mean(values), count
