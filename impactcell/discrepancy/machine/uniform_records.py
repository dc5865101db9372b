"""Records of a machine at equal steps, without spikes, and the sizes of their motion."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impactcell.campaign import Campaign
from impactcell.discrepancy.machine.base_model import BaseModel, Response
from impactcell.discrepancy.machine.channel_values import LARGEST, cleaned_position, held_mean, without_spikes
from impactcell.discrepancy.machine.smoothing import smoothed_acceleration, speed_noise
from impactcell.errors import CampaignError
from impactcell.features import drive_noise_std, is_command, white_noise_std
from impactcell.records import Capture, Samples

MIN_HALF_SUPPORT = 5
"""Least half support of a test function [samples]: fewer do not average the noise of a sensor."""
PERIODS_PER_SUPPORT = 0.25
"""Support of a test function over the period of the motion: a half swing has four rows [1]."""
SPEED_SUPPORT_SHARE = 0.25
"""Support by which a speed is smoothed at most, over that of a test function: direction turns fast [1]."""
MIN_SPEED_SUPPORT = 3
"""And at least, on either side [samples]."""
MAX_SPEED_NOISE = 0.001
"""Noise of a speed over the largest one, down to which it is smoothed: a fifth of what is turning [1]."""
MAX_HIDDEN_SHARE = 0.25
"""Share of the force's mean square that averaging over a test function may hide of the inertial force [1]."""
SPANS_PER_PERIOD = 11.0
"""Second differences over an eleventh of the period average as a test function of a quarter of it: the
triangle's standard deviation of span/sqrt(6) is that of (1 - s²)^4, half its support over sqrt(11)."""
LARGEST_ACCELERATION = 0.97
"""Share of the samples below what counts as the largest acceleration: a spike touches three of them [1]."""
MIN_SPAN = 2
"""Least span of a second difference [samples]: of one it is noise as a rule."""
FINEST = 16
"""Steps of sqrt(2) by which averaging is shortened at most: to a 256th [1]."""
LEVELLED = 1.02
"""Growth in such a step below which all of the acceleration is resolved [1]."""
MAX_NOISE_SHARE = 0.1
"""Share of the sensor's noise in the mean square of an acceleration beyond which it says nothing [1]."""


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
    finer : int
        Samples made of one of the sensors'; noise is then what white noise of the same density has.
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
    finer: int = 1

    @property
    def step_s(self) -> float:
        """Time from sample to sample."""
        return float(self.time_s[1] - self.time_s[0])

    @property
    def sensor_noise(self) -> tuple[float, float]:
        """Standard deviation of position and force as the sensors sample them."""
        return self.noise[0] / math.sqrt(self.finer), self.noise[1] / math.sqrt(self.finer)


@dataclass(frozen=True, slots=True, eq=False)
class MotionScale:
    """Sizes of the motion over all records.

    Attributes
    ----------
    period_s : float
        2 pi std(q) / std(q'), or less where accelerations are much shorter (`resolving_period`).
    speed, load : float
        Largest speed and load.
    low, high : float
        Range of positions.
    """

    period_s: float
    speed: float
    load: float
    low: float
    high: float

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Range of each covariate that a function may be one of."""
        return {"speed": (0.0, self.speed), "load": (0.0, self.load), "position": (self.low, self.high)}


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
    noise = [
        channel.noise_std if channel.noise_std is not None else estimate(clean)
        for channel, (clean, _), estimate in zip(
            channels, cleaned, (white_noise_std, drive_noise_std), strict=False
        )
    ]
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
        noise=(noise[0], abs(gain) * noise[1] if len(noise) > 1 else 0.0),
        noise_is_stated=(channels[0].noise_std is not None, channels[-1].noise_std is not None),
        force_is_command=is_held,
    )


def motion_scale(records: Sequence[UniformRecord], response: Response, gravity: float) -> MotionScale:
    """Sizes of the motion over all records, where gravity's torque is about `gravity`.

    Raises
    ------
    CampaignError
        Nothing moves.
    """
    moving = [record for record in records if np.ptp(record.position) > 0.0]
    if not moving:
        raise CampaignError("no record shows any motion")
    # Coarse speeds: over a twentieth of a record's samples at most, so that quantised positions do not count.
    speeds, places = [], []
    for record in moving:
        width = max(len(record.position) // 200, 1)
        speeds.append((record.position[width:] - record.position[:-width]) / (width * record.step_s))
        places.append(record.position - record.position.mean())
    speed = np.concatenate(speeds)
    period = 2.0 * math.pi * float(np.concatenate(places).std()) / float(np.sqrt(np.mean(speed**2)))
    position = np.concatenate([record.position for record in records])
    scale = MotionScale(
        resolving_period(moving, period),
        float(np.quantile(np.abs(speed), LARGEST)),
        0.0,
        float(position.min()),
        float(position.max()),
    )
    loads = [carried_load(response, record, record.force, (gravity, scale)) for record in records]
    return replace(scale, load=float(np.quantile(np.concatenate(loads), LARGEST)))


def resolving_period(records: Sequence[UniformRecord], period_s: float) -> float:
    """Give the longest period, at most `period_s`, whose test functions still show the accelerations.

    An axis that is ramped up within a tenth of a second and then runs for seconds has a period of seconds:
    averaged over a quarter of it, the ramps are gone, and with them what tells inertia from friction. The
    averaging is shortened until it hides at most `MAX_HIDDEN_SHARE` of the mean square of the force, inertia
    times acceleration over ever shorter spans.
    """
    sizes: list[float] = []
    for place in range(FINEST + 1):
        size = _inertial_force(records, period_s / math.sqrt(2.0) ** place)
        if size is None:
            break
        sizes.append(size)
        if place and size < LEVELLED * sizes[-2]:
            break
    if not sizes:
        return period_s
    whole = max(sizes)
    force = np.concatenate([record.force - record.force.mean() for record in records])
    hidden = whole - MAX_HIDDEN_SHARE * max(whole, float(np.mean(force**2)))
    return period_s / math.sqrt(2.0) ** next(place for place, size in enumerate(sizes) if size >= hidden)


def _inertial_force(records: Sequence[UniformRecord], period_s: float) -> float | None:
    """Mean square of inertia times acceleration, averaged as over a test function; None where it is noise."""
    total, noise, count = 0.0, 0.0, 0
    for record in records:
        span = round(period_s / SPANS_PER_PERIOD / record.step_s)
        if span < MIN_SPAN:
            return None
        if 4 * span > len(record.position):
            continue
        second = (
            record.position[2 * span :] - 2.0 * record.position[span:-span] + record.position[: -2 * span]
        )
        # What is left of a spike is a few large ones of them, and the finer the span the larger.
        second = np.minimum(np.abs(second), np.quantile(np.abs(second), LARGEST_ACCELERATION))
        scale = (record.inertia / (span * record.step_s) ** 2) ** 2
        total += scale * float(second @ second)
        noise += scale * 6.0 * len(second) * record.noise[0] ** 2  # variance of x - 2 y + z
        count += len(second)
    if not count or noise > MAX_NOISE_SHARE * total:
        return None
    return (total - noise) / count


def half_supports(record: UniformRecord, scale: MotionScale) -> tuple[int, int]:
    """Half support of a test function and of the smoothing of speeds [samples]."""
    half = max(int(0.5 * PERIODS_PER_SUPPORT * scale.period_s / record.step_s), MIN_HALF_SUPPORT)
    half = min(half, len(record.position) // 8)
    widest = max(int(SPEED_SUPPORT_SHARE * half), MIN_SPEED_SUPPORT)
    narrow = MIN_SPEED_SUPPORT
    while (
        narrow < widest
        and speed_noise(narrow, record.step_s) * record.noise[0] > MAX_SPEED_NOISE * scale.speed
    ):
        narrow += 1
    return half, narrow


def carried_load(
    response: Response, record: UniformRecord, force: Samples, gravity_and_scale: tuple[float, MotionScale]
) -> Samples:
    """|F + G sin(q - q_0)|, by which gear or guide is loaded, shape (n,).

    Where the drive is predicted, F is what a machine without friction needs, I q'' + G sin(q - q_0): a
    measured force holds the friction itself, and friction that goes by it would explain any friction. Nothing
    is known of a load then where no gravity acts.
    """
    gravity, scale = gravity_and_scale
    weight = gravity * np.sin(record.position)
    if response is Response.POSITION:
        return np.abs(force + weight)
    if gravity == 0.0:
        return np.zeros(weight.shape)
    half, narrow = half_supports(record, scale)
    accelerating = record.inertia * smoothed_acceleration(
        record.position, max(half // 2, narrow), record.step_s
    )
    return np.abs(accelerating + 2.0 * weight)
