"""Records of a machine at equal steps, without spikes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from impactcell.campaign import Campaign
from impactcell.discrepancy.machine.base_model import BaseModel, Response
from impactcell.discrepancy.machine.channel_values import cleaned_position, held_mean, without_spikes
from impactcell.errors import CampaignError
from impactcell.features import drive_noise_std, is_command, noise_std, samples_held, white_noise_std
from impactcell.records import Capture, Channel, Samples

MIN_HALF_SUPPORT = 5
"""Least half support of a test function [samples]: fewer do not average the noise of a sensor."""


@dataclass(frozen=True, slots=True, eq=False)
class UniformRecord:
    """One record at equal steps, without its spikes.

    Attributes
    ----------
    shot : int
    label : str
        Batch of the shot.
    time_s, position, force : ndarray, shape (n,)
        `force` is zero where nothing drives.
    inertia : float
    covariates : mapping
    spikes : int
        Samples that were replaced.
    noise : tuple of float
        Standard deviation of position and force: as stated, else from third differences.
    noise_is_stated : tuple of bool
    force_is_command : bool
        Held from its sample to the next, without noise.
    force_span : float
        Values that one sample of the force makes, where it is held or sampled more slowly than the position.
    finer : int
        Samples made of one of the sensors'. Noise is what white noise of the same density has.
    """

    shot: int
    label: str
    time_s: Samples
    position: Samples
    force: Samples
    inertia: float
    covariates: Mapping[str, float]
    spikes: int
    noise: tuple[float, float]
    noise_is_stated: tuple[bool, bool] = (False, False)
    force_is_command: bool = False
    force_span: float = 1.0
    finer: int = 1

    @property
    def step_s(self) -> float:
        """Time from sample to sample."""
        return float(self.time_s[1] - self.time_s[0])

    def part(self, first: int, last: int | None = None) -> "UniformRecord":
        """Take the samples from `first` on, to before `last`; time begins anew."""
        inside = slice(first, last)
        return replace(
            self,
            time_s=self.time_s[inside] - self.time_s[first],
            position=self.position[inside],
            force=self.force[inside],
        )

    @property
    def sensor_noise(self) -> tuple[float, float]:
        """Standard deviation of position and force as the sensors sample them."""
        position, force = self.noise
        return position / math.sqrt(self.finer), force / math.sqrt(self.finer * self.force_span)


def uniform_records(campaign: Campaign, base: BaseModel) -> tuple[UniformRecord, ...]:
    """Lay all shots out at equal steps, corrected by what the base model states of their sensors.

    The part is at q - q_0 where q is read, and driven by (1 + g) F + F_0 where F is; what is fitted later is
    how far q_0, g and F_0 are from what is stated.

    Raises
    ------
    CampaignError
        A shot lacks a channel or its inertia.
    """
    driven = any(shot.force is not None for shot in campaign.shots)
    return tuple(_uniform(shot, base, driven=driven) for shot in campaign.shots)


def _uniform(shot: Capture, base: BaseModel, *, driven: bool) -> UniformRecord:
    if shot.position is None:
        raise CampaignError(f"shot {shot.cycle}: has no position; a base model is about how the part moves")
    if driven and shot.force is None:
        raise CampaignError(f"shot {shot.cycle}: has no force where other shots have one")
    inertia = base.inertia.value if math.isfinite(base.inertia.value) else shot.mass_kg
    if not math.isfinite(inertia):
        raise CampaignError(f"shot {shot.cycle}: neither it nor the base model states an inertia or mass")
    channels = [shot.position] if shot.force is None else [shot.position, shot.force]
    begin = max(channel.time_s[0] for channel in channels)
    end = min(channel.time_s[-1] for channel in channels)
    step = float(np.median(np.diff(shot.position.time_s)))
    count = int((end - begin) / step + 1e-6) + 1 if end > begin else 0
    if count < 8 * MIN_HALF_SUPPORT:
        raise CampaignError(
            f"shot {shot.cycle}: {count} samples in common are too few; at least {8 * MIN_HALF_SUPPORT}"
        )
    time = begin + step * np.arange(count)
    is_held = len(channels) > 1 and base.response is Response.POSITION and is_command(channels[1].values)
    cleaned = [cleaned_position(shot.position.values), *(without_spikes(one.values) for one in channels[1:])]
    values = [
        np.interp(time, channel.time_s, clean) for channel, (clean, _) in zip(channels, cleaned, strict=True)
    ]
    if is_held:
        # What is switched for a moment is no spike.
        cleaned[1] = (channels[1].values, 0)
        values[1] = held_mean(channels[1].time_s, channels[1].values, time)
    stated = shot.position.noise_std is not None
    noise = noise_std(shot.position) if stated else white_noise_std(cleaned[0][0])
    force_noise, force_span = 0.0, 1.0
    if shot.force is not None:
        force_noise, force_span = _force_noise(shot.force, cleaned[1][0], step)
    covariates = {
        name: value
        for name, value in shot.covariates.items()
        if isinstance(value, float) and math.isfinite(value)
    }
    gain = 1.0 + base.force_gain.value
    return UniformRecord(
        shot=shot.cycle,
        label=shot.batch_id or "",
        time_s=time - begin,
        position=values[0] - base.position_offset.value,
        force=gain * values[1] + base.force_offset.value if len(values) > 1 else np.zeros(count),
        inertia=inertia,
        covariates=covariates,
        spikes=sum(spikes for _, spikes in cleaned),
        noise=(noise, abs(gain) * force_noise),
        noise_is_stated=(stated, channels[-1].noise_std is not None),
        force_is_command=is_held,
        force_span=force_span,
    )


def _force_noise(force: Channel, clean: Samples, step_s: float) -> tuple[float, float]:
    """Noise of a force in a record with so small steps, and values of the record that one sample makes.

    On the line between two samples noise has two thirds of a sample's variance in the mean, but its values go
    together: m of them, of one sample, add up to m times its error, as if each had sqrt(m) times that by
    itself. Rows average over many. So it is where a force stays the same for m values.
    """
    slower = max(float(np.median(np.diff(force.time_s))) / step_s, 1.0)
    held = samples_held(clean)
    noise = drive_noise_std(clean) if force.noise_std is None else noise_std(force) * math.sqrt(held)
    return noise * math.sqrt(slower), held * slower
