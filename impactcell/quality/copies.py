"""Records that are a copy of another: noise never comes twice."""

from collections.abc import Iterable, Sequence

from impactcell.numerics.spikes import noise_of
from impactcell.records import Samples

MIN_SAMPLES = 20
"""Samples of a record that no two have alike by chance."""


def copies(records: Iterable[Sequence[Samples]]) -> list[tuple[int, int]]:
    """Give the places of records all channels of which have the very samples of an earlier one, and of that.

    Records in which no channel shows noise are none: what is made without noise may well come again.
    """
    seen: dict[tuple[bytes, ...], int] = {}
    found = []
    for place, channels in enumerate(records):
        if not any(len(values) >= MIN_SAMPLES and noise_of(values) > 0.0 for values in channels):
            continue
        first = seen.setdefault(tuple(values.tobytes() for values in channels), place)
        if first != place:
            found.append((place, first))
    return found
