"""Features of the force of a capture by local fits: its peak, and when contact was last lost.

A raw maximum of a noisy force is some three standard deviations high; here every feature comes from a
polynomial fitted to the samples around it, over the widest window in which the residuals are noise.
"""

import math

import numpy as np

from impactcell.errors import CaptureError, ClippedForceError, NoSeparationError
from impactcell.features.channels import CheckedForce, smoothing_width
from impactcell.features.clipping import is_cut_off
from impactcell.features.measured import MeasuredFeature
from impactcell.numerics.local_polynomial import fit_polynomial, median, value_std, widest_cubic
from impactcell.records import Samples

MIN_WINDOW_S = 2.5e-4
"""Narrowest half window of the cubic about the peak: over 40 taps of 2000-6000 mm/min half or twice of
it changes the error of the peak by 1 %, four times raises it by 23 %."""
MAX_WINDOW_S = 4e-3
"""Widest half window of the cubic about the peak: a quarter of a contact of some 17 ms."""
BIAS_FACTOR = 1.5
"""Factor of the peak's standard deviation: the bias that Lepski's rule leaves is of the size of the noise."""
MIN_CLIPPED_RUN = 5
"""Equal largest samples in a row that noise does not produce."""
MIN_CONTACT_STD = 8.0
"""Least smoothed force of a contact, in standard deviations of a sample."""
THRESHOLD_STD, THRESHOLD_SHARE = 7.0, 0.005
"""Smoothed force above which there is contact: the larger of so many of its standard deviations, which noise
reaches once in 1e12, and of this share of its largest value. A compromise: at 5 the error of the separation
is larger by 9 %, at 10 by 16 %."""
IDLE_PART = 10
"""The force's last one in so many samples show what it is without contact: long after most of them."""
IDLE_FACTOR, MAX_IDLE_SHARE = 1.5, 0.05
"""Factor of the largest force without contact, of hum, drift or an offset, that a contact has to pass: a
tenth of a record of 60 ms sees 0.8 of the amplitude of 50 Hz at least. Above this share of the largest force
the part is taken to lean on the actuator."""
PRESSED_STD = 3.0
"""Least force of a sample that is used of the falling flank, in standard deviations of a sample."""
FLANK_S = 1.5e-3
"""Widest stretch of the falling flank that is extrapolated to zero. A compromise: over 40 taps of 2000-6000
mm/min the separation is off by 12 µs, as its standard deviation says; with 1 ms by 22 µs, with 3 ms by 11 µs
but by 1.7 of its standard deviations, for a parabola does not follow so far."""
FLANK_SHRINK, FLANK_ROUNDS = 1.6, 5
"""Factor by which the stretch is shortened until a parabola fits it, and how often: down to 0.23 ms."""


def peak_force(force: CheckedForce) -> MeasuredFeature:
    """Largest contact force of a capture, N, from a cubic fitted around it.

    Raises
    ------
    CaptureError
        It shows no contact.
    ClippedForceError
        The force is saturated.
    """
    refuse_clipped(force)
    sigma = force.sigma
    times, values, smooth = force.time_s, force.values, force.smooth
    top = int(smooth.argmax())
    if smooth[top] < MIN_CONTACT_STD * sigma:
        raise CaptureError(f"no contact: the force stays below {smooth[top]:.3g} N, noise is {sigma:.3g} N")
    peak = _fit_maximum(times, values, sigma, times[top], 1.0, 1.0)
    if peak is None:  # a jump beside the peak, as when the actuator halts within the contact
        sided = [_fit_maximum(times, values, sigma, times[top], *s) for s in ((1.0, 0.0), (0.0, 1.0))]
        peak = max((fit for fit in sided if fit is not None), key=lambda fit: fit.value, default=None)
    if peak is None:
        return MeasuredFeature(float(smooth[top]), sigma)
    return MeasuredFeature(peak.value, math.hypot(peak.std, _shared_std(force, 2.0 * MIN_WINDOW_S)))


def refuse_clipped(force: CheckedForce) -> None:
    """Raise `ClippedForceError` where the force stands at its full scale or on a plateau of equal samples."""
    if force.full_scale is not None and force.highest >= force.full_scale[1]:
        count = int((force.values >= force.full_scale[1]).sum())
        raise ClippedForceError(f"{count} force samples are at full scale, {force.full_scale[1]:.6g} N")
    if force.plateau >= MIN_CLIPPED_RUN and is_cut_off(force.values, force.plateau):
        raise ClippedForceError(
            f"{force.plateau} force samples in a row stand at {force.highest:.6g} N: clipped"
        )


def loss_of_contact(force: CheckedForce) -> MeasuredFeature:
    """Time at which contact was last lost, s, from the falling flank of the force extrapolated to zero.

    Raises
    ------
    CaptureError
        There was no contact.
    NoSeparationError
        The force had not fallen to zero when its record ended.
    """
    sigma, smooth = force.sigma, force.smooth
    highest = float(smooth.max())
    if highest < MIN_CONTACT_STD * sigma:
        raise CaptureError(f"no contact: the force stays below {highest:.3g} N, noise is {sigma:.3g} N")
    width = smoothing_width(force)
    threshold, unsure = _contact_threshold(force, width, highest)
    last = len(smooth) - 1 - int((smooth[::-1] > threshold).argmax())
    if last >= len(smooth) - max(2, width):
        raise NoSeparationError(f"the force was still {smooth[-1]:.3g} N when its record ended")
    times, values = force.time_s, force.values
    window, end_s = FLANK_S, float(times[last])
    for _ in range(FLANK_ROUNDS):
        first = int(times.searchsorted(end_s - window, "right"))
        pressed = values[first : last + 1] > PRESSED_STD * sigma
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
            error = math.hypot(unsure * value_std(factor, root), _shared_std(force, window))
            return MeasuredFeature(end_s + window * root, window * min(error / max(slope, 1e-300), 1.0))
        window /= FLANK_SHRINK
    near = times[max(0, last - 50) : last + 2]
    step = median(near[1:] - near[:-1])
    return MeasuredFeature(float(times[last] + 0.5 * step * width), step * width)


def contact_spells(force: CheckedForce) -> list[tuple[float, float]]:
    """Give the first and last time of each contact, s: of several where the actuator meets the part again."""
    times, smooth = force.time_s, force.smooth
    width = smoothing_width(force)
    threshold, _ = _contact_threshold(force, width, float(smooth.max()))
    touches = np.concatenate([[0], smooth > threshold, [0]]).astype(np.int8)
    turns = np.diff(touches)
    begins, ends = np.flatnonzero(turns > 0), np.flatnonzero(turns < 0)
    lasting = ends - begins > max(2, width)
    return list(zip(times[begins[lasting]].tolist(), times[ends[lasting] - 1].tolist(), strict=True))


def _contact_threshold(force: CheckedForce, width: int, highest: float) -> tuple[float, float]:
    """Smoothed force above which there is contact, and how unsure a sample of it is, N."""
    sigma, smooth = force.sigma, force.smooth
    threshold = max(THRESHOLD_STD * force.mean_std(width), THRESHOLD_SHARE * highest)
    idle = float(np.abs(smooth[-max(len(smooth) // IDLE_PART, 1) :]).max())
    if threshold < idle < MAX_IDLE_SHARE * highest:
        return IDLE_FACTOR * idle, sigma + idle
    return threshold, sigma


def _shared_std(force: CheckedForce, window_s: float) -> float:
    """Give the standard deviation of what the samples of a window have in common, N; 0 of white noise."""
    if force.shared_noise is None:
        return 0.0
    return force.mean_std(max(round(window_s / force.shared_noise.step_s), 1))


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
    narrowest_s = max(MIN_WINDOW_S, 4.0 * step)
    is_fitted, value, std = widest_cubic(
        times, values, sigma, (at_s, left, right), (narrowest_s, MAX_WINDOW_S, step)
    )
    return MeasuredFeature(value, BIAS_FACTOR * std) if is_fitted else None
