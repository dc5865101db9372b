"""Which shots have the same settings: replicates, whose scatter nothing but friction and noise makes."""

import math
from collections.abc import Sequence

import numpy as np

from impactcell.records import Capture

ALIKE_START = 0.01
"""Difference of two starts, over how far parts go in the median, up to which they are the same place [1]. A
start that was measured is another number in each shot, and what friction does to it over a hundredth of a
stroke is far below its scatter. Our choice."""
SAME = 9
"""Decimals in SI units to which what was told is compared."""


def start_places(captures: Sequence[Capture]) -> list[int]:
    """Give the number of the place at which each shot starts; starts are of one place up to `ALIKE_START`."""
    went = [float(np.ptp(shot.position.values)) for shot in captures if shot.position is not None]
    apart = max(ALIKE_START * float(np.median(went)) if went else 0.0, 10.0**-SAME)
    places = [0] * len(captures)
    place, first_m = -1, -math.inf
    for number in sorted(range(len(captures)), key=lambda number: captures[number].start_m):
        if not captures[number].start_m - first_m <= apart:
            place, first_m = place + 1, captures[number].start_m
        places[number] = place
    return places


def replicate_groups(captures: Sequence[Capture], places: Sequence[int]) -> list[int]:
    """Give the number of each shot's group, in order of appearance: those of one have the same settings.

    `places` are those at which the shots start.
    """
    groups: dict[tuple[float, ...], int] = {}
    return [
        groups.setdefault((*_told(capture), place), len(groups))
        for capture, place in zip(captures, places, strict=True)
    ]


def _told(capture: Capture) -> tuple[float, float, float]:
    """Velocity, mass and direction as they were told; -1 of what was not."""
    velocity, mass = (
        round(value, SAME) if math.isfinite(value) else -1.0
        for value in (capture.velocity_m_s, capture.mass_kg)
    )
    return velocity, mass, float(capture.direction)
