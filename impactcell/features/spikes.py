"""Leaves lone samples out that are neither noise nor motion: a disturbance of the line, not of the part."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from impactcell.numerics.spikes import spike_samples
from impactcell.records import Capture, Channel

MAX_LEFT_OUT = 10
"""Samples of a channel that may be left out; more are no accident; the residuals tell."""


def without_spikes(capture: Capture) -> tuple[Capture, tuple[str, ...]]:
    """Give a capture without its spikes, and what was left out; the capture itself where there is none."""
    cleaned: dict[str, Channel] = {}
    told = []
    for name in ("force", "position", "actuator"):
        channel: Channel | None = getattr(capture, name)
        spikes = _spikes(channel)
        if channel is None or not 0 < len(spikes) <= MAX_LEFT_OUT:
            continue
        time_s, values = np.delete(channel.time_s, spikes), np.delete(channel.values, spikes)
        cleaned[name] = replace(channel, time_s=time_s, values=values)
        told.append(f"{len(spikes)} outlier{'' if len(spikes) == 1 else 's'} of the {name} left out")
    if not cleaned:
        return capture, ()
    channels = {"force": capture.force, "position": capture.position, "actuator": capture.actuator, **cleaned}
    force, position, actuator = channels.values()
    return replace(capture, force=force, position=position, actuator=actuator), tuple(told)


def _spikes(channel: Channel | None) -> NDArray[np.intp]:
    if channel is None or len(channel.values) != len(channel.time_s) or not np.isfinite(channel.values).all():
        return np.empty(0, dtype=np.intp)
    return spike_samples(channel.values)
