"""Leaves samples out that were lost on the way: no numbers, one time given twice, a value that was held."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from impactcell.features.noise import white_noise_std
from impactcell.records import Capture, Channel, Samples

MAX_LOST_SHARE = 0.2
"""Share of a channel that may be lost; of one that has lost more nothing is left out. Our choice."""
CHANCE = 1e-6
"""Probability that noise makes a run of equal values anywhere in a channel from which on it is none."""
COARSE, MAX_CHANCE = 0.7, 0.4
"""Noise over the least step of a channel below which equal values are its raster's, for at rest they go on;
and the share of values that are repeated from which on it is so too."""
EXACT = 1e-6
"""Noise over the range of a channel below which it is computed, and stands still where the part does."""


def without_lost_samples(capture: Capture) -> tuple[Capture, tuple[str, ...]]:
    """Give a capture without what was lost, and how much; the capture itself where nothing was.

    A gap costs an estimate what it would have told; a held value or a zero in its place bends it.
    """
    cleaned: dict[str, Channel] = {}
    told = []
    for name in ("force", "position"):
        channel: Channel | None = getattr(capture, name)
        if channel is None or len(channel.values) != len(channel.time_s):
            continue
        lost = _lost(channel.time_s, channel.values)
        count = int(np.count_nonzero(lost)) if lost is not None else 0
        if lost is None or not 0 < count <= MAX_LOST_SHARE * len(lost):
            continue
        cleaned[name] = replace(channel, time_s=channel.time_s[~lost], values=channel.values[~lost])
        told.append(
            f"{count} lost sample{'' if count == 1 else 's'} of the {name} left out: check its cable and link"
        )
    if not cleaned:
        return capture, ()
    force, position = cleaned.get("force", capture.force), cleaned.get("position", capture.position)
    return replace(capture, force=force, position=position), tuple(told)


def _lost(times: Samples, values: Samples) -> NDArray[np.bool_] | None:
    """Mark what was lost; None where nothing was."""
    repeated = np.flatnonzero(values[1:] == values[:-1])
    twice = times[1:] == times[:-1]
    if len(repeated) < 2 and not twice.any() and math.isfinite(float(values.sum() + times.sum())):
        return None
    lost = ~np.isfinite(values + times)
    lost[1:] |= twice
    for first, last in _held_runs(values, repeated):
        lost[first : last + 1] = True
    return lost


def _held_runs(values: Samples, repeated: NDArray[np.intp]) -> list[tuple[int, int]]:
    """Give first and last sample of each run of equal values that noise does not make.

    Of n samples that each repeat the one before with the probability p, the share of new values that are
    repeated at once, a run of L is there by chance with a probability of at most n p^(L - 1). A run at either
    end of the channel's range is clipping, one at an end of the record may be a rest that was recorded so.
    """
    if len(repeated) < 2:
        return []
    breaks = np.flatnonzero(np.diff(repeated) > 1)
    firsts = repeated[np.concatenate([[0], breaks + 1])]
    lasts = repeated[np.concatenate([breaks, [len(repeated) - 1]])] + 1
    count = len(values)
    chance = max(len(firsts) / (count - len(repeated)), 1.0 / count)
    if chance > MAX_CHANCE:
        return []
    held = lasts - firsts > math.log(CHANCE / count) / math.log(chance)
    held &= (firsts > 0) & (lasts < count - 1)
    if not held.any():
        return []
    ends = float(np.nanmin(values)), float(np.nanmax(values))
    held &= ~np.isin(values[firsts], ends)
    if not held.any():
        return []
    finite = values[np.isfinite(values)]
    steps = np.abs(np.diff(finite))
    least = max(COARSE * float(np.min(steps[steps > 0.0], initial=math.inf)), EXACT * (ends[1] - ends[0]))
    if white_noise_std(finite) < least:
        return []
    return list(zip(firsts[held].tolist(), lasts[held].tolist(), strict=True))
