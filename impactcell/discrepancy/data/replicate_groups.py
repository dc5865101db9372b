"""Which shots have the same settings: replicates, whose scatter nothing but friction and noise makes."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from impactcell.records import Capture, Samples

ALIKE_START = 0.01
"""Difference of two starts, over how far parts go in the median, up to which they are the same place [1]. A
start that was measured is another number in each shot, and what friction does to it over a hundredth of a
stroke is far below its scatter. Our choice."""
ALIKE_VELOCITY = 0.02
"""Relative difference of two velocities up to which they are the same setting [1]. A velocity that an
actuator channel showed is another number in each tap: it scatters by up to 0.5 %, of which thirty taps span
four times as much, and settings that somebody chose are 5 % apart and more. Our choice."""
MEASURED_SHARE = 0.5
"""Share of shots with a velocity of their own, to nine decimals, from which on velocities may be measured:
those that were told come again. Our choice."""
AGAIN_SHARE = 0.9
"""Share of shots whose velocity came again, where it was measured [1]: of eight that were drawn at random so
many do in one campaign of some thousands. Our choice."""
SAME = 9
"""Decimals in SI units to which what was told is compared."""


def start_places(captures: Sequence[Capture]) -> list[int]:
    """Give the number of the place at which each shot starts; starts are of one place up to `ALIKE_START`."""
    went = [float(np.ptp(shot.position.values)) for shot in captures if shot.position is not None]
    apart = max(ALIKE_START * float(np.median(went)) if went else 0.0, 10.0**-SAME)
    return _numbered([shot.start_m for shot in captures], apart)


def velocity_settings(captures: Sequence[Capture]) -> list[int]:
    """Give the number of each shot's velocity; of measured ones those up to `ALIKE_VELOCITY` are the same.

    Velocities that were told come again: they are compared as they were told, also where they differ by
    less, and so are those that somebody drew at random, which do not stand apart. Those not known are one.
    """
    values = [round(shot.velocity_m_s, SAME) if shot.velocity_m_s > 0.0 else -1.0 for shot in captures]
    as_told = _numbered(values, 0.0)
    if len(set(values) - {-1.0}) > MEASURED_SHARE * len(captures):
        known = [math.log(shot.velocity_m_s) if shot.velocity_m_s > 0.0 else -math.inf for shot in captures]
        measured = _numbered(known, math.log1p(ALIKE_VELOCITY))
        if _stand_apart(np.array(known), np.array(measured)):
            return measured
    return as_told


def _stand_apart(values: Samples, numbers: NDArray[np.int_]) -> bool:
    """Whether more lies between two groups of numbered values than within any, and nearly all came again."""
    seen = np.isfinite(values)
    values, numbers = values[seen], numbers[seen]
    groups = [values[numbers == number] for number in np.unique(numbers)]
    widest = max(float(np.ptp(group)) for group in groups)
    nearest = min((float(after.min() - before.max()) for before, after in pairwise(groups)), default=math.inf)
    again = sum(len(group) for group in groups if len(group) > 1)
    return nearest > widest and again >= AGAIN_SHARE * len(values)


def _numbered(values: Sequence[float], apart: float) -> list[int]:
    """Give numbers to values in rising order: what lies no farther than `apart` above a first is one."""
    numbers = [0] * len(values)
    number, first = -1, -math.inf
    for place in sorted(range(len(values)), key=values.__getitem__):
        if number < 0 or (values[place] != first and not values[place] - first <= apart):
            number, first = number + 1, values[place]
        numbers[place] = number
    return numbers


def replicate_groups(captures: Sequence[Capture], places: Sequence[int]) -> list[int]:
    """Give the number of each shot's group, in order of appearance: those of one have the same settings.

    `places` are those at which the shots start.
    """
    groups: dict[tuple[float, ...], int] = {}
    return [
        groups.setdefault((velocity, *_told(capture), place), len(groups))
        for capture, velocity, place in zip(captures, velocity_settings(captures), places, strict=True)
    ]


def _told(capture: Capture) -> tuple[float, float]:
    """Mass and direction as they were told; -1 of a mass that was not."""
    mass = round(capture.mass_kg, SAME) if math.isfinite(capture.mass_kg) else -1.0
    return mass, float(capture.direction)
