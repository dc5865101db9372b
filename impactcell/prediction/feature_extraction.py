"""Figures read off the force of a capture by local fits: its peak, and when contact was last lost.

A raw maximum of a noisy force is some three standard deviations high; here every figure comes from a
polynomial fitted to the samples around it, over the widest window in which the residuals are noise.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.errors import (
    CaptureError,
    ClippedForceError,
    NoSeparationError,
)
from impactcell.numerics.local_polynomial import (
    channel_statistics,
    fit_polynomial,
    median,
    middle_second_difference,
    running_mean,
    value_std,
    widest_cubic,
)
from impactcell.records import Capture, Channel, Samples

CONTACT_SMOOTHING_S = 2e-4
"""Short against a contact of some 17 ms, long against a sample at 1 MHz."""
MAX_WINDOW_S = 4e-3
BIAS_FACTOR = 1.5
MIN_CLIPPED_RUN = 5
"""Equal largest samples in a row that noise does not produce."""


@dataclass(frozen=True, slots=True)
class MeasuredFeature:
    """A figure read off a capture, with one standard deviation."""

    value: float
    std: float


@dataclass(frozen=True, slots=True, eq=False)
class CheckedChannel(Channel):
    """A channel that has been checked, and what all readings of it need, found once.

    Attributes
    ----------
    sigma : float
        What `noise_std` gives.
    highest : float
    plateau : int
        The most samples in a row that stand exactly at `highest`.
    smooth : ndarray, shape (n,), or None
        Running mean over `CONTACT_SMOOTHING_S`, where it was asked for.
    """

    sigma: float = math.nan
    highest: float = math.nan
    plateau: int = 0
    smooth: Samples | None = None


def check_if_usable(channel: Channel | None, name: str, *, smoothed: bool = False) -> Channel | None:
    """Check a channel once for all readings; one that nothing can be read from stays as it is."""
    try:
        given = check_channel(channel, name)
    except CaptureError:
        return channel
    return replace(given, smooth=_smooth(given)) if smoothed else given


def check_channel(channel: Channel | None, name: str) -> CheckedChannel:
    """Refuse a channel nothing can be read from.

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
    if len(channel.values) < 8:
        raise CaptureError(f"the {name} record has only {len(channel.values)} samples")
    if not ascending:
        raise CaptureError(f"the times of the {name} record do not increase")
    if highest == lowest:
        raise CaptureError(f"the {name} is constant at {channel.values[0]:.6g}")
    return CheckedChannel(
        channel.time_s, channel.values, channel.noise_std, channel.full_scale, channel.resolution,
        noise_std(channel), highest, plateau,
    )  # fmt: skip


def displacement(capture: Capture) -> CheckedChannel:
    """Position of a capture counted from where the part lay, positive along +1.

    Recorders differ in where they count from: that place, or the table's zero. The first samples, taken
    while the part has hardly moved, tell which.

    Raises
    ------
    CaptureError
        As `check_channel`.
    """
    position = check_channel(capture.position, "position")
    first = sorted(position.values[:5].tolist())[2]
    if abs(first - capture.start_m) < abs(first):
        values = position.values - capture.start_m
        return replace(position, values=values, highest=position.highest - capture.start_m)
    return position


def noise_std(channel: Channel) -> float:
    """Give the standard deviation of one sample: the sensor's white noise and the raster of its code.

    Where the sensor's noise is not known it is taken from second differences, by their median.
    """
    if isinstance(channel, CheckedChannel):
        return channel.sigma
    raster = (channel.resolution or 0.0) / math.sqrt(12.0)
    if channel.noise_std is not None:
        return math.hypot(channel.noise_std, raster)
    white = 1.4826 * middle_second_difference(channel.values) / math.sqrt(6.0)
    return max(white, raster, 1e-9 * float(np.abs(channel.values).max()))


def peak_force(channel: Channel) -> MeasuredFeature:
    """Largest contact force of a capture, N, from a cubic fitted around it.

    Raises
    ------
    CaptureError
        The channel cannot be used, or shows no contact.
    ClippedForceError
        The force is saturated.
    """
    force = check_channel(channel, "force")
    refuse_clipped(force)
    sigma = noise_std(force)
    times, values = force.time_s, force.values
    smooth = _smooth(force)
    top = int(smooth.argmax())
    if smooth[top] < 8.0 * sigma:
        raise CaptureError(f"no contact: the force stays below {smooth[top]:.3g} N, noise is {sigma:.3g} N")
    found = _fit_maximum(times, values, sigma, times[top], 1.0, 1.0)
    if found is None:  # a jump beside the peak, as when the actuator halts within the contact
        sided = [_fit_maximum(times, values, sigma, times[top], *s) for s in ((1.0, 0.0), (0.0, 1.0))]
        found = max((one for one in sided if one is not None), key=lambda one: one.value, default=None)
    return found or MeasuredFeature(float(smooth[top]), sigma)


def refuse_clipped(force: CheckedChannel) -> None:
    """Raise `ClippedForceError` where the force stands at its full scale or on a plateau of equal samples."""
    if force.full_scale is not None and force.highest >= force.full_scale[1]:
        count = int((force.values >= force.full_scale[1]).sum())
        raise ClippedForceError(f"{count} force samples are at full scale, {force.full_scale[1]:.6g} N")
    if force.plateau >= MIN_CLIPPED_RUN and (force.resolution or 0.0) < 2.0 * (force.noise_std or 0.0):
        raise ClippedForceError(
            f"{force.plateau} force samples in a row stand at {force.highest:.6g} N: clipped"
        )


def loss_of_contact(force: Channel) -> MeasuredFeature:
    """Time at which contact was last lost, s, from the falling flank of the force extrapolated to zero.

    Raises
    ------
    CaptureError
        There was no contact.
    NoSeparationError
        The force had not fallen to zero when its record ended.
    """
    sigma = noise_std(force)
    smooth = _smooth(force)
    highest = float(smooth.max())
    if highest < 8.0 * sigma:
        raise CaptureError(f"no contact: the force stays below {highest:.3g} N, noise is {sigma:.3g} N")
    width = _smoothing_width(force)
    threshold = max(7.0 * sigma / math.sqrt(width), 0.005 * highest)
    last = len(smooth) - 1 - int((smooth[::-1] > threshold).argmax())
    if last >= len(smooth) - max(2, width):
        raise NoSeparationError(f"the force was still {smooth[-1]:.3g} N when its record ended")
    times, values = force.time_s, force.values
    window, end_s = 1.5e-3, float(times[last])
    for _ in range(5):
        first = int(times.searchsorted(end_s - window, "right"))
        pressed = values[first : last + 1] > 3.0 * sigma
        falling = values[first : last + 1][pressed]
        freedom = len(falling) - 3
        if freedom < 3:
            break
        parabola, factor, squares = fit_polynomial(
            times[first : last + 1][pressed], falling, end_s, window, 2
        )
        real = [root for root in _real_roots(*parabola.tolist()) if -0.5 < root < 1.0]
        if real and squares / sigma**2 < freedom + 4.0 * math.sqrt(2.0 * freedom):
            root = min(real, key=abs)
            slope = abs(float(parabola[1] + 2.0 * parabola[2] * root))
            error = sigma * value_std(factor, root)
            return MeasuredFeature(end_s + window * root, window * min(error / max(slope, 1e-300), 1.0))
        window /= 1.6
    near = times[max(0, last - 50) : last + 2]
    step = median(near[1:] - near[:-1])
    return MeasuredFeature(float(times[last] + 0.5 * step * width), step * width)


def _smoothing_width(channel: Channel) -> int:
    step = float(channel.time_s[-1] - channel.time_s[0]) / (len(channel.time_s) - 1)
    return max(1, min(round(CONTACT_SMOOTHING_S / step), len(channel.values) // 4))


def _smooth(channel: Channel) -> Samples:
    if isinstance(channel, CheckedChannel) and channel.smooth is not None:
        return channel.smooth
    width = _smoothing_width(channel)
    if width == 1:
        return channel.values
    return running_mean(channel.values, width)


def _real_roots(c0: float, c1: float, c2: float) -> tuple[float, ...]:
    """Real zeros of c0 + c1 u + c2 u²."""
    if c2 == 0.0:
        return (-c0 / c1,) if c1 else ()
    inside = c1 * c1 - 4.0 * c0 * c2
    if not inside >= 0.0:
        return ()
    larger = -0.5 * (c1 + math.copysign(math.sqrt(inside), c1))
    return (larger / c2, c0 / larger) if larger else (0.0,)


def _fit_maximum(
    times: Samples, values: Samples, sigma: float, at_s: float, left: float, right: float
) -> MeasuredFeature | None:
    """Maximum of a cubic about `at_s`; what bias stays is of the size of the noise: hence `BIAS_FACTOR`."""
    step = median(times[1:100] - times[: min(len(times), 100) - 1])
    narrowest_s = max(2.5e-4, 4.0 * step)
    found, value, std = widest_cubic(times, values, sigma, at_s, left, right, narrowest_s, MAX_WINDOW_S, step)
    return MeasuredFeature(value, BIAS_FACTOR * std) if found else None
