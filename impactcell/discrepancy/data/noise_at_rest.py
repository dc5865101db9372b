"""What the samples before contact say of the noise: all of it, where neighbouring ones show a part."""

from collections.abc import Iterator

import numpy as np

from impactcell.campaign import Campaign
from impactcell.features import white_noise_std
from impactcell.records import Samples

TOLD_IN = {"force": (1.0, "N", "noise_std_n"), "position": (1e6, "µm", "noise_std_m")}
"""Channels at rest before contact: what their noise is told in, and its key in `campaign.yaml`."""
FEWEST_SAMPLES = 30
"""Of a shot before contact; the standard deviation of as many is good to 13 %."""
LAST_SAMPLES = 3
"""Samples before contact that are left out: contact lies within a sampling step."""
CORRELATED_RATIO = 1.3
"""Scatter at rest over that of neighbouring samples from which on it is told: a gap as large may be none."""


def correlated_noise(recorded: Campaign, counted: Campaign) -> list[str]:
    """Say of which channels whose noise is not stated it is larger than neighbouring samples show.

    Both are the median over the shots, so that neither spikes nor a few shots decide.

    Parameters
    ----------
    recorded, counted : Campaign
        Of taps with the samples before contact, and what `from_contact` makes of it.
    """
    notes = []
    for channel, (scale, unit, key) in TOLD_IN.items():
        resting = list(_resting(recorded, counted, channel))
        if not resting:
            continue
        scatter = float(np.median([values.std(ddof=1) for values in resting]))
        white = float(np.median([white_noise_std(values) for values in resting]))
        if scatter > CORRELATED_RATIO * white > 0.0:
            notes.append(
                f"At rest before contact {channel} scatters by {scale * scatter:.3g} {unit}, "
                f"{scatter / white:.3g} times what neighbouring samples show: its noise is correlated, and a "
                f"gap of as much may be the sensor's. State {key} of sensors: {channel} in campaign.yaml, "
                "and run again."
            )
    return notes


def _resting(recorded: Campaign, counted: Campaign, name: str) -> Iterator[Samples]:
    for before, after in zip(recorded.shots, counted.shots, strict=True):
        whole, kept = getattr(before, name), getattr(after, name)
        if whole is None or kept is None or whole.noise_std is not None:
            continue
        values = whole.values[: max(len(whole.values) - len(kept.values) - LAST_SAMPLES, 0)]
        values = values[np.isfinite(values)]
        if len(values) >= FEWEST_SAMPLES:
            yield values
