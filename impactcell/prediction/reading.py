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
from impactcell.records import Capture, Channel, Samples

CONTACT_SMOOTHING_S = 2e-4
"""Short against a contact of some 17 ms, long against a sample at 1 MHz."""
WIDEST_WINDOW_S = 4e-3
BIASED = 1.5
CLIPPED_RUN = 5
"""Equal largest samples in a row that noise does not produce."""


@dataclass(frozen=True, slots=True)
class Reading:
    """A figure read off a capture, with one standard deviation."""

    value: float
    std: float


def checked(channel: Channel | None, name: str) -> Channel:
    """Refuse a channel nothing can be read from.

    Raises
    ------
    CaptureError
        It is missing, empty, not finite, not ordered in time or constant.
    """
    if channel is None:
        raise CaptureError(f"no {name} was recorded")
    if len(channel.values) == 0:
        raise CaptureError(f"the {name} record is empty")
    if len(channel.values) != len(channel.time_s):
        raise CaptureError(
            f"the {name} record has {len(channel.values)} samples at {len(channel.time_s)} times"
        )
    bad = len(channel.values) - int(np.isfinite(channel.values + channel.time_s).sum())
    if bad:
        raise CaptureError(f"{bad} of {len(channel.values)} {name} samples are not numbers")
    if len(channel.values) < 8:
        raise CaptureError(f"the {name} record has only {len(channel.values)} samples")
    if not (channel.time_s[1:] > channel.time_s[:-1]).all():
        raise CaptureError(f"the times of the {name} record do not increase")
    if channel.values.max() == channel.values.min():
        raise CaptureError(f"the {name} is constant at {channel.values[0]:.6g}")
    return channel


def displacement(capture: Capture) -> Channel:
    """Position of a capture counted from where the part lay, positive along +1.

    Recorders differ in where they count from: that place, or the table's zero. The first samples, taken
    while the part has hardly moved, tell which.

    Raises
    ------
    CaptureError
        As `checked`.
    """
    position = checked(capture.position, "position")
    first = float(np.median(position.values[:5]))
    if abs(first - capture.start_m) < abs(first):
        return replace(position, values=position.values - capture.start_m)
    return position


def noise_std(channel: Channel) -> float:
    """Give the standard deviation of one sample: the sensor's white noise and the raster of its code.

    Where the sensor's noise is not known it is taken from second differences, by their median.
    """
    raster = (channel.resolution or 0.0) / math.sqrt(12.0)
    if channel.noise_std is not None:
        return math.hypot(channel.noise_std, raster)
    second = np.diff(channel.values, 2)
    white = 1.4826 * float(np.median(np.abs(second))) / math.sqrt(6.0)
    return max(white, raster, 1e-9 * float(np.abs(channel.values).max()))


def peak_force(channel: Channel) -> Reading:
    """Largest contact force of a capture, N, from a cubic fitted around it.

    Raises
    ------
    CaptureError
        The channel cannot be used, or shows no contact.
    ClippedForceError
        The force is saturated.
    """
    force = checked(channel, "force")
    refuse_clipped(force)
    sigma = noise_std(force)
    times, values = force.time_s, force.values
    smooth = _smooth(force)
    top = int(np.argmax(smooth))
    if smooth[top] < 8.0 * sigma:
        raise CaptureError(f"no contact: the force stays below {smooth[top]:.3g} N, noise is {sigma:.3g} N")
    found = _widest_fit(times, values, sigma, times[top], sides=(1.0, 1.0))
    if found is None:  # a jump beside the peak, as when the actuator halts within the contact
        sided = [_widest_fit(times, values, sigma, times[top], sides=s) for s in ((1.0, 0.0), (0.0, 1.0))]
        found = max((one for one in sided if one is not None), key=lambda one: one.value, default=None)
    return found or Reading(float(smooth[top]), sigma)


def refuse_clipped(force: Channel) -> None:
    """Raise `ClippedForceError` where the force stands at its full scale or on a plateau of equal samples."""
    highest = float(force.values.max())
    if force.full_scale is not None and highest >= force.full_scale[1]:
        count = int((force.values >= force.full_scale[1]).sum())
        raise ClippedForceError(f"{count} force samples are at full scale, {force.full_scale[1]:.6g} N")
    at_top = np.flatnonzero(force.values == highest)
    runs = np.split(at_top, np.flatnonzero(np.diff(at_top) > 1) + 1)
    longest = max(len(run) for run in runs)
    if longest >= CLIPPED_RUN and (force.resolution or 0.0) < 2.0 * (force.noise_std or 0.0):
        raise ClippedForceError(f"{longest} force samples in a row stand at {highest:.6g} N: clipped")


def loss_of_contact(force: Channel) -> Reading:
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
    last = int(np.flatnonzero(smooth > threshold)[-1])
    if last >= len(smooth) - max(2, width):
        raise NoSeparationError(f"the force was still {smooth[-1]:.3g} N when its record ended")
    times, values = force.time_s, force.values
    window = 1.5e-3
    for _ in range(5):
        near = (times > times[last] - window) & (times <= times[last]) & (values > 3.0 * sigma)
        if near.sum() < 6:
            break
        origin, scale = times[last], window
        u = (times[near] - origin) / scale
        basis = np.vander(u, 3)
        coefficients, *_ = np.linalg.lstsq(basis, values[near])
        residual = values[near] - basis @ coefficients
        freedom = len(u) - 3
        roots = np.roots(coefficients)
        real = [root.real for root in roots if abs(root.imag) < 1e-9 and -0.5 < root.real < 1.0]
        if real and (residual @ residual) / sigma**2 < freedom + 4.0 * math.sqrt(2.0 * freedom):
            root = min(real, key=abs)
            leverage = np.vander([root], 3)[0]
            error = sigma * math.sqrt(float(leverage @ np.linalg.inv(basis.T @ basis) @ leverage))
            slope = abs(float(np.polyval(np.polyder(coefficients), root)))
            return Reading(float(origin + scale * root), scale * min(error / max(slope, 1e-300), 1.0))
        window /= 1.6
    step = float(np.median(np.diff(times[max(0, last - 50) : last + 2])))
    return Reading(float(times[last] + 0.5 * step * width), step * width)


def _smoothing_width(channel: Channel) -> int:
    step = float(channel.time_s[-1] - channel.time_s[0]) / (len(channel.time_s) - 1)
    return max(1, min(round(CONTACT_SMOOTHING_S / step), len(channel.values) // 4))


def _smooth(channel: Channel) -> Samples:
    width = _smoothing_width(channel)
    if width == 1:
        return channel.values
    running = np.concatenate([np.zeros(1), np.cumsum(channel.values)])
    index = np.arange(len(channel.values))
    first = np.maximum(index - width // 2, 0)
    last = np.minimum(index - width // 2 + width, len(index))
    smooth: Samples = (running[last] - running[first]) / (last - first)
    return smooth


def _widest_fit(
    times: Samples, values: Samples, sigma: float, at_s: float, sides: tuple[float, float]
) -> Reading | None:
    """Maximum of a cubic over the widest window about `at_s` in which its residuals are noise.

    Lepski's rule: windows grow until the residuals, or the maximum against those of narrower windows,
    show more than noise. What bias stays is of the size of the noise: hence the factor `BIASED`.
    """
    accepted: Reading | None = None
    earlier: list[Reading] = []
    step = float(np.median(np.diff(times[:100])))
    half = max(2.5e-4, 4.0 * step)
    centre = at_s
    while half <= WIDEST_WINDOW_S or accepted is None:
        first = int(np.searchsorted(times, centre - sides[0] * half - 0.01 * step, "left"))
        last = int(np.searchsorted(times, centre + sides[1] * half + 0.01 * step, "right"))
        if last - first < 6:
            half *= 1.3
            if half > 4.0 * WIDEST_WINDOW_S:
                return accepted
            continue
        u = (times[first:last] - centre) / half
        basis = np.vander(u, 4)
        gram = np.linalg.inv(basis.T @ basis)
        coefficients = gram @ (basis.T @ values[first:last])
        residual = values[first:last] - basis @ coefficients
        freedom = last - first - 4
        if (residual @ residual) / sigma**2 > freedom + 3.0 * math.sqrt(2.0 * freedom):
            break
        grid = np.linspace(u[0], u[-1], 81)
        best = grid[int(np.argmax(np.polyval(coefficients, grid)))]
        leverage = np.vander([best], 4)[0]
        reading = Reading(
            float(leverage @ coefficients), sigma * math.sqrt(float(leverage @ gram @ leverage))
        )
        if any(abs(reading.value - before.value) > 2.0 * before.std for before in earlier):
            break
        accepted = Reading(reading.value, BIASED * reading.std)
        earlier.append(reading)
        if sides == (1.0, 1.0):
            centre = float(np.clip(centre + half * best, at_s - half, at_s + half))
        half *= 1.3
    return accepted
