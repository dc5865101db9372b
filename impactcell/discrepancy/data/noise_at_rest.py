"""What samples at rest say of the noise: all of it, where neighbouring ones show a part."""

import math
from collections.abc import Iterator

import numpy as np

from impactcell.campaign import Campaign, Excitation
from impactcell.features import white_noise_std
from impactcell.records import Samples

TOLD_IN = {"force": (1.0, "N", "noise_std_n"), "position": (1e6, "µm", "noise_std_m")}
"""Channels at rest before contact and after the tap: what their noise is told in, its key in the YAML."""
FEWEST_SAMPLES = 30
"""Of a shot before contact; the standard deviation of as many is good to 13 %."""
LAST_SAMPLES = 3
"""Samples before contact that are left out: contact lies within a sampling step."""
TAIL_SAMPLES = 150
"""Last samples of a shot in which the part has to lie still for any of them to be used: 15 ms at 10 kHz."""
STILL_RATIO = 1.5
"""Scatter of these over that of their last half, up to which it lies still: 2 or more where it moves on."""
CERTAIN_EXCESS = 2.0
"""Excess of the scatter at rest over that of neighbouring samples from which on it is told, times the root of
the samples of a shot: white noise in 24 shots made 1.4 at most in 180 draws (0.25 with 30, 0.06 with 400)."""


def correlated_noise(recorded: Campaign, counted: Campaign) -> list[str]:
    """Say of which channels whose noise is not stated it is larger than neighbouring samples show.

    Both are the median over the shots, so that neither spikes nor a few shots decide. Taps rest before
    contact, and where they were not recorded there after they have slid.

    Parameters
    ----------
    recorded, counted : Campaign
        Of taps with the samples before contact, and what `from_contact` makes of it.
    """
    notes = []
    for channel, (scale, unit, key) in TOLD_IN.items():
        where, resting = "before contact", list(_before_contact(recorded, counted, channel))
        if not resting and recorded.excitation is Excitation.TAP:
            where, resting = "after the tap", list(_after_the_tap(counted, channel))
        if not resting:
            continue
        scatter = float(np.median([values.std(ddof=1) for values in resting]))
        white = float(np.median([white_noise_std(values) for values in resting]))
        excess = CERTAIN_EXCESS / math.sqrt(np.median([len(values) for values in resting]))
        if scatter > (1.0 + excess) * white > 0.0:
            notes.append(
                f"At rest {where} {channel} scatters by {scale * scatter:.3g} {unit}, "
                f"{scatter / white:.3g} times what neighbouring samples show: its noise is correlated or has "
                f"outliers, and a gap of as much may be the sensor's. State {key} of sensors: {channel} in "
                "campaign.yaml, and run again."
            )
    return notes


def _before_contact(recorded: Campaign, counted: Campaign, name: str) -> Iterator[Samples]:
    for before, after in zip(recorded.shots, counted.shots, strict=True):
        whole, kept = getattr(before, name), getattr(after, name)
        if whole is None or kept is None or whole.noise_std is not None:
            continue
        values = whole.values[: max(len(whole.values) - len(kept.values) - LAST_SAMPLES, 0)]
        values = values[np.isfinite(values)]
        if len(values) >= FEWEST_SAMPLES:
            yield values


def _after_the_tap(counted: Campaign, name: str) -> Iterator[Samples]:
    """Last samples of each shot, as far back as they lie about the same value."""
    for shot in counted.shots:
        channel = getattr(shot, name)
        if channel is None or channel.noise_std is not None:
            continue
        values = channel.values[np.isfinite(channel.values)]
        tail = values[-TAIL_SAMPLES:]
        scatter = float(tail[len(tail) // 2 :].std()) if len(tail) == TAIL_SAMPLES else 0.0
        if not 0.0 < float(tail.std()) <= STILL_RATIO * scatter:
            continue
        blocks = values[len(values) % TAIL_SAMPLES :].reshape(-1, TAIL_SAMPLES)
        near = np.abs(blocks.mean(1) - tail.mean()) <= scatter
        still = int(np.argmin(near[::-1])) if not near.all() else len(blocks)
        yield values[len(values) - max(still, 1) * TAIL_SAMPLES :]
