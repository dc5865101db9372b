"""Force without contact: what is taken off the force of each tap, and how that is told."""

from collections.abc import Sequence

import numpy as np

from impactcell.records import Samples

TOLD_ZERO = 1e-3
"""Force without contact, over the largest of a tap, from which on it is told to have been taken off [1]."""


def force_at_rest(force: Samples, onset: int | None) -> float:
    """Force without contact, from the samples before it [N]."""
    before = force[: max((onset or 0) - 1, 0)]
    return float(np.median(before)) if len(before) >= 3 else 0.0


def notes_of_zeros(taps: Sequence[tuple[Samples, int | None]]) -> list[str]:
    """Tell the force without contact that is taken off, of taps by their force and where contact begins."""
    zeros = [zero for force, onset in taps if (zero := force_at_rest(force, onset))]
    if not zeros:
        return []
    largest = float(np.median([force.max() for force, _ in taps]))
    if abs(float(np.median(zeros))) < TOLD_ZERO * largest:
        return []
    told = taps_in_words(len(zeros))
    return [f"force of {span(zeros, '.3g')} N without contact taken off, in {told}"]


def taps_in_words(count: int) -> str:
    """Say how many taps there are."""
    return "1 tap" if count == 1 else f"{count} taps"


def span(values: Sequence[float], spec: str) -> str:
    """Say from where to where values go, or the one that all are as they are written."""
    low, high = format(min(values), spec), format(max(values), spec)
    return low if low == high else f"{low} to {high}"
