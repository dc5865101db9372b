"""Records of a machine at equal steps, without spikes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from impactcell.campaign import Campaign
from impactcell.discrepancy.machine.records.channel_noise import force_noise, position_noise
from impactcell.discrepancy.machine.records.channel_values import cleaned_position, held_mean, without_spikes
from impactcell.discrepancy.machine.records.lost_stretches import (
    MOST_CLIPPED,
    Gaps,
    as_it_was_beside,
    clipped_samples,
    gaps_of,
    sound_neighbours,
)
from impactcell.discrepancy.machine.records.smoothing import of_speeds, slope_weights
from impactcell.discrepancy.machine.records.uneven_steps import at_equal_steps, values_of_a_sample
from impactcell.discrepancy.machine.terms.base_model import BaseModel, Response
from impactcell.errors import CampaignError
from impactcell.features import is_command
from impactcell.records import Capture, Samples

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
        Standard deviation of position and force: as stated, else from third differences. Of a position that
        was summed up from a speed it is the speed's.
    noise_is_stated : tuple of bool
    command : ndarray, shape (n,), or None
        Force that is held from its sample to the next, without noise: its mean from each sample to the next,
        where `force` is that from half a sample before to half a sample after; None of a measured one.
    summed_up : bool
        The position is the sum of a recorded speed, and so is its noise.
    position_span, force_span : float
        Values that one sample makes in the mean, where others were lost; of a force also where it is held or
        sampled more slowly than the position. `noise` has the root of it more than a sample.
    finer : int
        Samples made of one of the sensors'. Noise is what white noise of the same density has.
    gaps : tuple of (float, float)
        Time from the last sample before to the first one after a stretch in which one of the channels has
        none, or is clipped. What values there are between is nothing that was measured.
    clipped : int
        Samples of a channel that are clipped, and so in a gap.
    at_limit : bool
        The force stands at an end of its range so often that it is its drive's own, and counts.
    stated_inertia : float
        Inertia or mass that `shots.csv` states, whichever is taken; nan where it does not.
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
    position_span: float = 1.0
    force_span: float = 1.0
    finer: int = 1
    gaps: Gaps = ()
    clipped: int = 0
    at_limit: bool = False
    stated_inertia: float = math.nan
    command: Samples | None = None
    summed_up: bool = False

    @property
    def force_is_command(self) -> bool:
        """Whether the force is held from its sample to the next, without noise."""
        return self.command is not None

    @property
    def step_s(self) -> float:
        """Time from sample to sample."""
        return float(self.time_s[1] - self.time_s[0])

    def part(self, first: int, last: int | None = None) -> "UniformRecord":
        """Take the samples from `first` on, to before `last`; time begins anew."""
        inside, begin_s = slice(first, last), float(self.time_s[first])
        time_s = self.time_s[inside] - begin_s
        gaps = [(low - begin_s, high - begin_s) for low, high in self.gaps]
        return replace(
            self,
            time_s=time_s,
            position=self.position[inside],
            force=self.force[inside],
            command=None if self.command is None else self.command[inside],
            gaps=tuple((low, high) for low, high in gaps if low < time_s[-1] and high > 0.0),
        )

    def is_whole(self, before: int = 0, after: int = 0) -> NDArray[np.bool_]:
        """Whether each sample, and so many before and after it, lie in no gap, shape (n,)."""
        size = len(self.time_s)
        lost = np.zeros(size, dtype=bool)
        for low, high in self.gaps:
            lost[np.searchsorted(self.time_s, low, "right") : np.searchsorted(self.time_s, high)] = True
        count, place = np.concatenate([[0], np.cumsum(lost)]), np.arange(size)
        whole: NDArray[np.bool_] = (
            count[np.minimum(place + after + 1, size)] == count[np.maximum(place - before, 0)]
        )
        return whole

    def pieces(self) -> list[slice]:
        """Give the samples between its gaps, piece by piece."""
        whole = np.concatenate([[False], self.is_whole(), [False]])
        edges = np.flatnonzero(np.diff(whole)).tolist()
        return [slice(*piece) for piece in zip(edges[::2], edges[1::2], strict=True)]

    @property
    def longest_piece(self) -> slice:
        """Longest of them."""
        return max(self.pieces(), key=lambda piece: piece.stop - piece.start, default=slice(0, 0))

    def noise_gain(self, weight: Samples) -> float:
        """Variance of the position's noise in a sum of so weighted samples, over `noise` squared."""
        weights = of_speeds(weight, self.step_s) if self.summed_up else weight
        return float(weights @ weights)

    def speed_noise(self, half: int) -> float:
        """Noise of a speed that is smoothed over so many samples on either side."""
        return math.sqrt(self.noise_gain(slope_weights(half))) / self.step_s * self.noise[0]

    @property
    def position_noise(self) -> float:
        """Standard deviation of the position as the sensors sample it; at its end where it was summed up."""
        added_up = self.step_s * math.sqrt(self.finer * len(self.position)) if self.summed_up else 1.0
        return self.sensor_noise[0] * added_up

    @property
    def sensor_noise(self) -> tuple[float, float]:
        """Standard deviation of position and force as the sensors sample them."""
        position, force = self.noise
        made_of_position, made_of_force = self.finer * self.position_span, self.finer * self.force_span
        return position / math.sqrt(made_of_position), force / math.sqrt(made_of_force)


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
    _check_columns(shot, base)
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
    clipped = [
        clipped_samples(name, channel) for name, channel in zip(("position", "force"), channels, strict=False)
    ]
    at_limit = bool(clipped[1:]) and float(clipped[1].mean()) > MOST_CLIPPED
    if at_limit:
        clipped[1][:] = False
    lost = [sound_neighbours(one.time_s, beyond) for one, beyond in zip(channels, clipped, strict=True)]
    cleaned = [
        as_it_was_beside(around, channel, *clean(channel.values))
        for around, channel, clean in zip(lost, channels, (cleaned_position, without_spikes), strict=False)
    ]
    values = [at_equal_steps(channels[0].time_s, cleaned[0][0], time)]
    values += [
        np.interp(time, channel.time_s, clean)
        for channel, (clean, _) in zip(channels[1:], cleaned[1:], strict=True)
    ]
    command = None
    if is_held:
        # What is switched for a moment is no spike.
        cleaned[1] = (channels[1].values, 0)
        half = 0.5 * step
        values[1] = held_mean(channels[1].time_s, channels[1].values, time - half, time + half)
        command = held_mean(channels[1].time_s, channels[1].values, time, time + step)
    noise, stated = position_noise(shot.position, cleaned[0][0])
    spans = [values_of_a_sample(channel.time_s, time) for channel in channels]
    noise_of_force, held = (0.0, 1.0) if shot.force is None else force_noise(shot.force, cleaned[1][0])
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
        noise=(noise * math.sqrt(spans[0]), abs(gain) * (noise_of_force * math.sqrt(spans[-1]))),
        noise_is_stated=(stated, channels[-1].noise_std is not None),
        position_span=spans[0],
        force_span=held * spans[-1] if shot.force is not None else 1.0,
        gaps=gaps_of(channels, lost, base.delay_s, begin),
        clipped=sum(int(beyond.sum()) for beyond in clipped),
        at_limit=at_limit,
        stated_inertia=shot.mass_kg,
        command=None if command is None else gain * command + base.force_offset.value,
        summed_up=shot.position.summed_up,
    )


def _check_columns(shot: Capture, base: BaseModel) -> None:
    """See that no term goes by a text.

    Raises
    ------
    CampaignError
        One does.
    """
    for choice in base.terms:
        value = shot.covariates.get(choice.covariate)
        if isinstance(value, str):
            raise CampaignError(
                f"shot {shot.cycle}: {choice.covariate!r} in shots.csv is {value!r}, and {choice.identifier} "
                "goes by its numbers; write a number in each row, or leave the term out of the base model"
            )
