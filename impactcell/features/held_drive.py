"""A drive that is held from one update to the next: a command of chosen levels, or one that was measured."""

import math

import numpy as np
from numpy.typing import NDArray

from impactcell.features.noise import white_noise_std
from impactcell.records import Samples

MAX_UPDATES = 0.55
"""Share of samples that differ from the one before, up to which a drive is held from update to update."""
SWITCHED_LEVELS = 3
"""Values that a drive takes up to which it is switched: on, off and the other way."""
MIN_JUMP_STEPS = 4.0
"""Usual jump of a held drive, in least differences between its values, below which they may be a coarse code:
that goes by one or two."""
SKIPPING_SHARE = 0.25
"""Share of the jumps that pass over a level, between two that are held, from which on levels are chosen: of a
coarse code with noise of 0.6 steps, which hardly stays at any, it is one in thirty [1]."""
MAX_OFF_CLOCK = 1.0
"""Samples by which a time between two updates may miss a multiple of the drive's own clock."""
CLOCK_CHANCE = 1e-4
"""Chance of times of any length to be such multiples, below which they are [1]."""
MIN_UPDATES = 8
"""Of a drive, below which they show no noise."""
COMMAND_SHARE = 0.25
"""Apparent noise of the updates over their spread, above which each is chosen by itself."""


def drive_noise_std(values: Samples, times: Samples | None = None) -> float:
    """Estimate the noise of a drive, which may be held from one update to the next.

    Of a drive that is not held it is `white_noise_std`, by its times where they are given. What is held
    shows no noise between its updates; if it was measured, its updates do, as any samples, and white noise of
    the same density is the root of how many samples one is held larger. A command has none: 0.
    """
    places = _updates(values)
    if not len(places):
        return white_noise_std(values, times)
    if is_command(values):
        return 0.0
    return white_noise_std(values[places]) * math.sqrt(samples_held(values))


def samples_held(values: Samples) -> float:
    """Count the samples for which a measured drive is held; 1 for one that is not, and for a command."""
    if is_command(values) or not len(places := _updates(values)):
        return 1.0
    return float(np.median(np.diff(places)))


def is_command(values: Samples) -> bool:
    """Whether a drive is held and its updates differ as if each were chosen by itself.

    As of a drive that is switched to and fro or takes random levels: what was measured goes on from one
    update to the next.

    Examples
    --------
    >>> chosen = np.repeat(5.0 * np.random.default_rng(1).integers(0, 5, 40), 25)
    >>> is_command(chosen), is_command(np.round(2.0 * np.sin(0.01 * np.arange(1000.0))))
    (True, False)
    """
    places = _updates(values)
    return bool(len(places)) and (
        len(np.unique(values)) <= SWITCHED_LEVELS or _differ_as_chosen(values[places])
    )


def _differ_as_chosen(updates: Samples) -> bool:
    """Whether updates do not go on from one another, or are too few to tell."""
    return len(updates) < MIN_UPDATES or white_noise_std(updates) > COMMAND_SHARE * float(updates.std())


def _updates(values: Samples) -> NDArray[np.int64]:
    """Places from which on a held drive has another value; none where it is not held."""
    steps = np.diff(values)
    places: NDArray[np.int64] = np.flatnonzero(steps) + 1
    if not 0 < len(places) <= MAX_UPDATES * len(steps):
        return places[:0]
    levels = np.unique(values)
    raster = float(np.diff(levels).min())
    jump = float(np.median(np.abs(steps[places - 1])))
    if len(levels) > SWITCHED_LEVELS and jump < MIN_JUMP_STEPS * raster and not _is_chosen(values, places):
        return places[:0]  # a coarse code, one step after the other
    return places


def _is_chosen(values: Samples, places: NDArray[np.int64]) -> bool:
    """Whether levels as close as the steps of a coarse code were chosen all the same.

    What is rounded goes from one step to the next, and at no times of its own: where it passes over one in
    no time, it stays at neither. Levels that are chosen are held and passed over, or change by a clock.
    """
    held = np.diff(places, prepend=0, append=len(values))
    level = np.searchsorted(np.unique(values), values[np.concatenate([[0], places])])
    skips = (np.abs(np.diff(level)) > 1) & (np.minimum(held[:-1], held[1:]) > 1)
    if float(skips.mean()) >= SKIPPING_SHARE:
        return True
    return _goes_by_a_clock(held[1:-1]) and _differ_as_chosen(values[places])


def _goes_by_a_clock(held: NDArray[np.int64]) -> bool:
    """Whether so many samples from update to update are multiples of one time, closer than by chance."""
    clock = float(held.sum() / np.rint(held / held.min()).sum())
    off = float(np.abs(held - clock * np.rint(held / clock)).max())
    by_chance = min((2.0 * MAX_OFF_CLOCK + 1.0) / clock, 1.0)
    return off <= MAX_OFF_CLOCK and by_chance ** (len(held) - 1) < CLOCK_CHANCE
