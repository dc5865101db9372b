"""The free slide of a capture: distance from the last loss of contact to rest, and deceleration."""

import cmath
import math
from dataclasses import dataclass

import numpy as np

from impactcell.errors import NoSeparationError, NoStopError
from impactcell.features.channels import CheckedChannel, rest_samples
from impactcell.features.measured import MeasuredFeature
from impactcell.numerics.local_polynomial import fit_polynomial, mean, median, value_at, value_std
from impactcell.records import Samples

# Halved or doubled, none of these changes the distance of 200 taps of 2000-6000 mm/min, sampled at 1 to 10
# kHz, by 1 %, but for the last two.
MOVING_STD = 8.0
"""Distance from the level of rest at which a sample still slides, in standard deviations of a sample."""
MIN_SLIDING = 8
"""Samples of a slide at least: twice those that fix a cubic."""
MAX_IMAGINARY, EARLIEST_STOP, LATEST_STOP = 0.2, 0.7, 1.6
"""What a zero of the speed must be to be the stop: nearly real, and between these; in units of the time from
the separation to the last sample that still slides."""
MIN_AT_REST = 3
"""Samples after the stop from which the level of rest is averaged; with fewer it is the cubic's value."""
QUIET_SAMPLES, QUIET_STD = 30, 5.0
"""Samples that show whether a part is at rest, and the most that their slope may be, in its standard
deviations."""
HALF_WINDOWS_S = (2e-3, 4e-3, 8e-3)
"""Half windows about the separation within which the position is a cubic; the narrowest that holds enough
samples. From 4 ms on the distance is off by 1.4 times as much, and by 4 of its standard deviations."""
MIN_IN_WINDOW = 8
"""What is enough: twice the samples that fix a cubic. At 1 kHz it makes the window 4 ms wide to either side,
and the distance is off by 1.4 of its standard deviations over all these taps; with 16 by 9, with 4 by 1.0."""


@dataclass(frozen=True, slots=True)
class SlideFeatures:
    """The free slide of a tap.

    Attributes
    ----------
    distance : MeasuredFeature
        From the last loss of contact to rest, m, positive along the tap.
    separation_s, stop_s : float
        Times of the last loss of contact and of rest.
    deceleration : MeasuredFeature
        Mean deceleration of the slide, m/s².
    bend : float
        How far the deceleration at either end of the slide is from its mean, m/s²: 0 but for noise where
        friction is the same all along.
    pushed_m : float
        How far the part had come along the tap when contact was last lost, m.
    """

    distance: MeasuredFeature
    separation_s: float
    stop_s: float
    deceleration: MeasuredFeature
    bend: float
    pushed_m: float


def extract_slide(path: CheckedChannel, separation: MeasuredFeature) -> SlideFeatures:
    """Extract the free slide: from the last loss of contact to rest, and how the part braked.

    Parameters
    ----------
    path : CheckedChannel
        Displacement, positive along the tap.
    separation : MeasuredFeature
        Time at which contact was last lost, s.

    Raises
    ------
    NoSeparationError, NoStopError
        The part did not leave the actuator, or had not come to rest, when the record ended.
    """
    times, moved, sigma = path.time_s, path.values, path.sigma
    separation_s = separation.value
    if separation_s >= times[-rest_samples(len(moved))]:
        raise NoSeparationError("contact was lost only when the position record ended")
    start = _value_at_separation(times, moved, separation_s, sigma)
    rest, stop_s, deceleration, bend = _rest_and_deceleration(times, moved, separation_s, sigma)
    speed = max(deceleration.value, 0.0) * (stop_s - separation_s)
    error = math.hypot(rest.std, start.std, speed * separation.std)
    distance = MeasuredFeature(rest.value - start.value, error)
    return SlideFeatures(distance, separation_s, stop_s, deceleration, bend, start.value)


def _rest_and_deceleration(
    times: Samples, moved: Samples, separation_s: float, sigma: float
) -> tuple[MeasuredFeature, float, MeasuredFeature, float]:
    """Level at rest, time of rest, mean deceleration and its bend, from polynomials through the slide."""
    final = median(moved[-rest_samples(len(moved)) :])
    first = int(times.searchsorted(separation_s, "right"))
    sliding = final - moved[first:] > MOVING_STD * sigma
    if np.count_nonzero(sliding) < MIN_SLIDING:
        raise NoStopError(
            "the slide after the last contact is too short for its position samples: where the actuator "
            "caught up with the part, tap faster or with a shorter stroke"
        )
    last = len(times) - 1 - int(sliding[::-1].argmax())
    slid = slice(first, last + 1)
    origin, span = separation_s, float(times[last] - separation_s)
    cubic, factor, _ = fit_polynomial(times[slid], moved[slid], origin, span, 3)
    _, c1, c2, c3 = cubic.tolist()
    last_speed, braking = c1 + 2.0 * c2 + 3.0 * c3, -(2.0 * c2 + 6.0 * c3)
    # The zero of the speed next after the last sample that still moved is the stop.
    stops = [root.real for root in _complex_roots(c1, 2.0 * c2, 3.0 * c3) if abs(root.imag) < MAX_IMAGINARY]
    stops = [root for root in stops if EARLIEST_STOP < root < LATEST_STOP]
    if stops:
        stop = min(stops, key=lambda root: abs(root - 1.0))
    else:  # cut off on the way, or braked otherwise than a cubic says
        stop = 1.0 + (last_speed / braking if braking > 0.0 else math.inf if last_speed > 0.0 else 0.0)
    stop_s = origin + span * max(stop, 1.0)
    first_quiet = (last + len(times)) // 2  # what lies after it is at rest, if anything is
    if stop_s > times[-1] and not _is_at_rest(times[first_quiet:], moved[first_quiet:], sigma):
        speed_mm_per_s = 1e3 * last_speed / span
        raise NoStopError(f"the part was still moving at {speed_mm_per_s:.3g} mm/s when the record ended")
    stop_s = min(stop_s, float(times[-1]))
    at_rest = moved[times.searchsorted(stop_s, "right") if stop_s < times[-1] else first_quiet :]
    if len(at_rest) >= MIN_AT_REST:
        rest = MeasuredFeature(mean(at_rest), sigma / math.sqrt(len(at_rest)))
    else:
        rest = MeasuredFeature(value_at(cubic, stop), sigma * value_std(factor, 1.0))
    parabola, factor, _ = fit_polynomial(times[slid], moved[slid], origin, span, 2)
    # The inverse of the normal equations has 1 / L² in its last place: the variance of the highest power.
    deceleration = MeasuredFeature(
        -2.0 * float(parabola[2]) / span**2, 2.0 * sigma / float(factor[2, 2]) / span**2
    )
    return rest, float(stop_s), deceleration, 3.0 * abs(c3) / span**2


def _complex_roots(c0: float, c1: float, c2: float) -> tuple[complex, ...]:
    """Zeros of c0 + c1 u + c2 u², complex ones too."""
    if c2 == 0.0:
        return (-c0 / c1,) if c1 else ()
    root = cmath.sqrt(c1 * c1 - 4.0 * c0 * c2)
    return (-c1 + root) / (2.0 * c2), (-c1 - root) / (2.0 * c2)


def _is_at_rest(times: Samples, moved: Samples, sigma: float) -> bool:
    """Whether a stretch of positions shows no motion, long enough to tell."""
    if len(times) < QUIET_SAMPLES:
        return False
    slope = float(np.polyfit(times - times.mean(), moved, 1)[0])
    return abs(slope) < QUIET_STD * sigma / math.sqrt(float(np.square(times - times.mean()).sum()))


def _value_at_separation(times: Samples, values: Samples, at_s: float, sigma: float) -> MeasuredFeature:
    """Value of a smooth channel at a time, from a cubic through its neighbourhood."""
    for half in HALF_WINDOWS_S:
        first = int(times.searchsorted(at_s - half, "left"))
        last = int(times.searchsorted(at_s + half, "right"))
        if last - first >= MIN_IN_WINDOW:
            scale = max(at_s - float(times[first]), float(times[last - 1]) - at_s)
            cubic, factor, _ = fit_polynomial(times[first:last], values[first:last], at_s, scale, 3)
            return MeasuredFeature(float(cubic[0]), sigma * value_std(factor, 0.0))
    return MeasuredFeature(float(np.interp(at_s, times, values)), sigma)
