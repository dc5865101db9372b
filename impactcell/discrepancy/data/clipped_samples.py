"""Leaves samples out that show the end of a channel's range, and not the part."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from impactcell.discrepancy.data.prepared_shots import CHANNELS, PreparedShot
from impactcell.quality import DataFault
from impactcell.records import Samples

MAX_DIP = 5
"""Samples between two at the end of the range that only noise has brought below it."""


def without_clipped_samples(
    shots: Sequence[PreparedShot], data_faults: Sequence[DataFault], notes: list[str]
) -> list[PreparedShot]:
    """Leave out what stands at an end at which a shot's channel is clipped; `notes` gains that it is.

    The samples beside it are measured well: of a contact its flanks stay.
    """
    ends = [fault for fault in data_faults if fault.end is not None]
    kept = [_within_range(shot, [fault for fault in ends if fault.shot == shot.number]) for shot in shots]
    changed = sum(after.size < before.size for before, after in zip(shots, kept, strict=True))
    if changed:
        notes.append(f"Clipped samples of {changed} shots are left out of the fits.")
    return kept


def _within_range(shot: PreparedShot, clipped: Iterable[DataFault]) -> PreparedShot:
    times, values = list(shot.times), list(shot.values)
    for fault in clipped:
        channel = CHANNELS.index(fault.channel)
        kept = ~_stands_at(fault.end, values[channel])
        times[channel], values[channel] = times[channel][kept], values[channel][kept]
    return replace(shot, times=(times[0], times[1], times[2]), values=(values[0], values[1], values[2]))


def _stands_at(end: float | None, values: Samples) -> NDArray[np.bool_]:
    """Whether each sample is at an end of the range, or dips from it between two that are."""
    at_end = np.flatnonzero(values == end)
    stands = np.zeros(len(values), dtype=np.bool_)
    stands[at_end] = True
    for first, last in pairwise(at_end):
        if last - first <= MAX_DIP + 1:
            stands[first:last] = True
    return stands
