"""Channels of a capture: refused where they show nothing, and what all features need of them."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from impactcell.errors import CaptureError, NoBreakawayError
from impactcell.features.noise import noise_std
from impactcell.numerics.local_polynomial import channel_statistics, mean, running_mean
from impactcell.numerics.raster import step_of
from impactcell.numerics.rest_level import FEWEST, rest_level
from impactcell.records import Capture, Channel, Samples, since_contact

CONTACT_SMOOTHING_S = 2e-4
"""Window of the smoothed force: short against a contact of some 17 ms, long against a sample at 1 MHz."""
MIN_SAMPLES = 8
"""Fewest samples of a channel that any feature can be extracted from: twice those that fix a cubic."""
HARDLY_MOVED_S = 2e-4
"""Time after contact [s] in which a part struck at 0.1 m/s moves by 20 µm at most."""
OFFSET_STD = 6.0
"""Least offset of a channel that is one, in standard deviations of what it is told by."""
MIN_MOTION_STD = 6.0
"""Least motion of a part that moved, in standard deviations of a position sample."""


@dataclass(frozen=True, slots=True, eq=False)
class CheckedChannel(Channel):
    """A channel that has been checked, with what all features of it need.

    Attributes
    ----------
    sigma : float
        What `noise_std` gives: the standard deviation of one sample.
    highest : float
        Largest value.
    plateau : int
        The most samples in a row that stand exactly at `highest`.
    """

    sigma: float = math.nan
    highest: float = math.nan
    plateau: int = 0

    def mean_std(self, count: int) -> float:
        """Give the standard deviation of the mean of so many samples, of which neighbours may share noise."""
        white = self.sigma / math.sqrt(count)
        if self.shared_noise is None:
            return white
        return max(white, min(self.shared_noise.mean_std(count), self.sigma))

    def halves_std(self, count: int) -> float:
        """Give that of the difference of the means of the two halves of so many samples."""
        white = self.sigma * math.sqrt(4.0 / count)
        return white if self.shared_noise is None else max(white, self.shared_noise.difference_std(count))


@dataclass(frozen=True, slots=True, eq=False)
class CheckedForce(CheckedChannel):
    """A force that has been checked.

    Attributes
    ----------
    smooth : ndarray, shape (n,)
        Running mean over `CONTACT_SMOOTHING_S`.
    """

    smooth: Samples = field(default_factory=lambda: np.empty(0))

    def after_contact(self) -> "CheckedForce":
        """Give the samples after first contact, at which the force jumps and has no one value."""
        since = since_contact(self.time_s)
        time_s, values, smooth = (samples[since] for samples in (self.time_s, self.values, self.smooth))
        return replace(self, time_s=time_s, values=values, smooth=smooth)


def check_channel(channel: Channel | None, name: str) -> CheckedChannel:
    """Refuse a channel that nothing can be extracted from.

    Raises
    ------
    CaptureError
        It is missing, empty, not finite, not ordered in time or constant.
    """
    if isinstance(channel, CheckedChannel):
        return channel
    if channel is None:
        raise CaptureError(f"no {name} was recorded")
    if len(channel.values) == 0:
        raise CaptureError(f"the {name} record is empty")
    if len(channel.values) != len(channel.time_s):
        raise CaptureError(
            f"the {name} record has {len(channel.values)} samples at {len(channel.time_s)} times"
        )
    bad, ascending, lowest, highest, plateau = channel_statistics(channel.time_s, channel.values)
    if bad:
        raise CaptureError(f"{bad} of {len(channel.values)} {name} samples are not numbers")
    if len(channel.values) < MIN_SAMPLES:
        raise CaptureError(f"the {name} record has only {len(channel.values)} samples")
    if not ascending:
        raise CaptureError(f"the times of the {name} record do not increase")
    if highest == lowest:
        raise CaptureError(f"the {name} is constant at {channel.values[0]:.6g}")
    return CheckedChannel(
        channel.time_s, channel.values, channel.noise_std, channel.full_scale, channel.resolution,
        zero_std=channel.zero_std, shared_noise=channel.shared_noise, sigma=noise_std(channel),
        highest=highest, plateau=plateau,
    )  # fmt: skip


def displacement(capture: Capture) -> CheckedChannel:
    """Position of a capture counted from where the part lay, positive along +1.

    Recorders differ in where they count from: that place, the table's zero, or anywhere else. The samples
    before contact, or the first after it while the part has hardly moved, tell which.

    Raises
    ------
    CaptureError
        As `check_channel`.
    """
    position = check_channel(capture.position, "position")
    first = sorted(position.values[:5].tolist())[2]
    if abs(first - capture.start_m) < abs(first):
        values = position.values - capture.start_m
        position = replace(position, values=values, highest=position.highest - capture.start_m)
    return _from_rest(position, capture)


def _from_rest(position: CheckedChannel, capture: Capture) -> CheckedChannel:
    """Count from where the part lay: by the samples before contact, where there are some.

    Else by the first ones, if the record stands elsewhere while the part hardly can have moved: until t a
    part of mass m goes no farther than F t² / (2 m), with F its largest force, nor than v t of an actuator of
    velocity v. A zero that is 2 µm off bends mu_s by a quarter.
    """
    if position.zero_std > 0.0:
        return position
    before = int(np.searchsorted(position.time_s, 0.0, "right"))
    if before >= FEWEST:
        level, zero_std = rest_level(
            position.values[:before], position.sigma, step_of(position.values, position.resolution)
        )
        return _counted_from(position, level, zero_std)
    count = int(np.searchsorted(position.time_s[:FEWEST], HARDLY_MOVED_S, "right"))
    resting = position.values[: max(count, 1)]
    level, until_s = float(np.median(resting)), max(float(position.time_s[len(resting) - 1]), 0.0)
    ways = [capture.velocity_m_s * until_s]
    if capture.force is not None and len(capture.force.values) and capture.mass_kg > 0.0:
        ways.append(0.5 * float(capture.force.values.max()) / capture.mass_kg * until_s**2)
    way = min((one for one in ways if one > 0.0), default=0.0)
    if abs(level) <= OFFSET_STD * position.sigma + way:
        return position
    return _counted_from(position, level, math.hypot(position.sigma / math.sqrt(len(resting)), way))


def _counted_from(position: CheckedChannel, level: float, zero_std: float) -> CheckedChannel:
    values = position.values - level
    return replace(position, values=values, highest=position.highest - level, zero_std=zero_std)


def smoothing_width(channel: Channel) -> int:
    """Give the samples of `CONTACT_SMOOTHING_S`, at most a quarter of the record."""
    step = float(channel.time_s[-1] - channel.time_s[0]) / (len(channel.time_s) - 1)
    return max(1, min(round(CONTACT_SMOOTHING_S / step), len(channel.values) // 4))


def check_force(channel: Channel | None) -> CheckedForce:
    """Check a force and smooth it.

    Raises
    ------
    CaptureError
        As `check_channel`.
    """
    if isinstance(channel, CheckedForce):
        return channel
    force = check_channel(channel, "force")
    width = smoothing_width(force)
    smooth = force.values if width == 1 else running_mean(force.values, width)
    return CheckedForce(
        force.time_s, force.values, force.noise_std, force.full_scale, force.resolution,
        zero_std=force.zero_std, shared_noise=force.shared_noise, sigma=force.sigma,
        highest=force.highest, plateau=force.plateau, smooth=smooth,
    )  # fmt: skip


def path_along_tap(displacement: CheckedChannel, direction: int) -> CheckedChannel:
    """Give the displacement as positive along the tap.

    Raises
    ------
    NoBreakawayError
        The part did not move.
    """
    moved = direction * displacement.values
    tail = rest_samples(len(moved))
    least = MIN_MOTION_STD * displacement.sigma
    if abs(mean(moved[-tail:]) - mean(moved[:tail])) < least:
        raise NoBreakawayError(f"the part moved less than {least:.3g} m")
    return replace(displacement, values=moved)


def rest_samples(count: int) -> int:
    """Give the samples at the end of a position record of `count` that tell where the part came to rest."""
    return max(5, count // 50)
