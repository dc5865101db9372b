"""How the samples of many taps lie in one row: which are whose, of which channel."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from impactcell.errors import PhysicsError
from impactcell.numerics.jit import IntArray
from impactcell.physics import memory_layout as at
from impactcell.physics.batch_integration import NO_SAMPLES
from impactcell.records import Samples


class SampleLayout(NamedTuple):
    """Where the samples of every tap and channel lie.

    Attributes
    ----------
    times : ndarray, shape (N,)
        Of all samples, end to end, s.
    sample_index : ndarray, shape (taps, SAMPLE_INDEX_COUNT)
        Begin and end of each channel of each tap, as `memory_layout` has them.
    channels : list of slice or ndarray
        Samples of each channel, tap after tap.
    """

    times: Samples
    sample_index: IntArray
    channels: list[slice | IntArray]


def lay_out_samples(
    times_by_channel: Sequence[Sequence[Samples] | None], taps: int, *, by_tap: bool
) -> SampleLayout:
    """Lay samples end to end: channel after channel, or tap after tap.

    Parameters
    ----------
    times_by_channel : sequence
        For each channel the ascending sample times of every tap, s; None for a channel without any.
    taps : int
    by_tap : bool
        Tap after tap, in a tap channel after channel, instead of the other way round.

    Raises
    ------
    PhysicsError
        Times do not ascend, or are no numbers.
    """
    index = [[0] * at.SAMPLE_INDEX_COUNT for _ in range(taps)]
    pairs = [(channel, i) for channel in range(at.CHANNEL_COUNT) for i in range(taps)]
    pieces: list[Samples] = []
    total, checked, times = 0, NO_SAMPLES, NO_SAMPLES
    for channel, i in sorted(pairs, key=lambda pair: pair[1]) if by_tap else pairs:
        of_taps = times_by_channel[channel]
        given = NO_SAMPLES if of_taps is None else of_taps[i]
        if given is not checked:  # taps may share theirs
            times, checked = _ascending(given, i), given
        pieces.append(times)
        index[i][channel] = total
        total += times.size
        index[i][at.CHANNEL_COUNT + channel] = total
    spans = [[(row[k], row[at.CHANNEL_COUNT + k]) for row in index] for k in range(at.CHANNEL_COUNT)]
    channels: list[slice | IntArray] = [
        np.concatenate([np.arange(begin, end) for begin, end in span])
        if by_tap
        else slice(span[0][0] if span else 0, span[-1][1] if span else 0)
        for span in spans
    ]
    return SampleLayout(
        np.concatenate(pieces) if pieces else NO_SAMPLES,
        np.array(index, dtype=np.int64).reshape(-1, at.SAMPLE_INDEX_COUNT),
        channels,
    )


def _ascending(given: Samples, tap: int) -> Samples:
    times = np.asarray(given, dtype=np.float64)
    if not (np.isfinite(times).all() and (times[1:] >= times[:-1]).all()):
        raise PhysicsError(f"tap {tap}: sample times must ascend and be numbers")
    return times
