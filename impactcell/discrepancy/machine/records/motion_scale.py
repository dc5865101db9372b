"""Sizes of a machine's motion: its period, speed, load and range, and over how long its rows average."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from impactcell.discrepancy.machine.records.channel_values import LARGEST
from impactcell.discrepancy.machine.records.smoothing import (
    second_difference,
    smoothed_acceleration,
    test_function,
)
from impactcell.discrepancy.machine.records.uniform_records import MIN_HALF_SUPPORT, UniformRecord
from impactcell.discrepancy.machine.terms.base_model import Response
from impactcell.errors import CampaignError
from impactcell.records import Samples

PERIODS_PER_SUPPORT = 0.25
"""Support of a test function over the period of the motion: a half swing has four rows [1]."""
MAX_ACCELERATION_NOISE = 0.003
"""Noise of a row's acceleration over the largest one down to which supports are made wider where nothing
drives, and a motion has no more than its period: what slows a bob is a hundredth of its weight [1]."""
WIDER, WIDENINGS = math.sqrt(2.0), 4
"""By how much at a time [1], and how often at most: to a whole period, which leaves two thirds of a sine
and a 32nd of white noise."""
SPEED_SUPPORT_SHARE = 0.25
"""Support by which a speed is smoothed at most, over that of a test function: direction turns fast [1]."""
MIN_SPEED_SUPPORT = 3
"""And at least, on either side [samples]."""
MAX_SPEED_NOISE = 0.001
"""Noise of a speed over the largest one, down to which it is smoothed: a fifth of what is turning [1]."""
MAX_HIDDEN_SHARE = 0.25
"""Share of the mean square of what moves the part that averaging over a test function may hide [1]."""
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
TOO_MANY_GAPS = (
    "samples are missing or clipped so often that between the gaps nothing is long enough for the equation "
    "of motion; record without gaps, in a wider range, or a slower motion in more samples"
)
"""Where no stretch of a record between its gaps is long enough."""


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
    many_turns : bool
        That range is of a rotation through many turns.
    """

    period_s: float
    speed: float
    load: float
    low: float
    high: float
    many_turns: bool = False

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Range of each covariate that a function may be one of."""
        return {"speed": (0.0, self.speed), "load": (0.0, self.load), "position": (self.low, self.high)}


def motion_scale(records: Sequence[UniformRecord], response: Response, gravity: float) -> MotionScale:
    """Sizes of the motion over all records, where gravity's torque is about `gravity`.

    Raises
    ------
    CampaignError
        Nothing moves, or gaps in time leave nothing of it.
    """
    moving = [record for record in records if np.ptp(record.position) > 0.0]
    if not moving:
        raise CampaignError("no record shows any motion")
    # Coarse speeds, so that quantised positions do not count.
    speeds, places = [], []
    for record in moving:
        speed = coarse_speed(record.position, 200, record.step_s)
        speed = speed[record.is_whole(after=len(record.position) - len(speed))[: len(speed)]]
        if speed.size:
            place = record.position[record.is_whole()]
            speeds.append(speed)
            places.append(place - place.mean())
    if not speeds:
        raise CampaignError(TOO_MANY_GAPS)
    speed = np.concatenate(speeds)
    period = period_of(np.concatenate(places), speed)
    position = np.concatenate([record.position for record in records])
    scale = MotionScale(
        resolving_period(moving, period, response),
        float(np.quantile(np.abs(speed), LARGEST)),
        0.0,
        float(position.min()),
        float(position.max()),
    )
    loads = [
        carried_load(response, record, record.force, (gravity, scale))[is_told(record, scale)]
        for record in records
    ]
    load = np.concatenate(loads)
    if not load.size:
        raise CampaignError(TOO_MANY_GAPS)
    return replace(scale, load=float(np.quantile(load, LARGEST)))


def coarse_speed(position: Samples, parts: int, step_s: float) -> Samples:
    """Mean speeds over one of so many parts of the samples; none of a single sample."""
    width = max(len(position) // parts, 1)
    return (position[width:] - position[:-width]) / (width * step_s)


def period_of(position: Samples, speed: Samples) -> float:
    """2 pi std(q) / rms(q'), which of a sine is its period."""
    return 2.0 * math.pi * float(position.std()) / float(np.sqrt(np.mean(speed**2)))


def resolving_period(records: Sequence[UniformRecord], period_s: float, response: Response) -> float:
    """Give the longest period, at most `period_s`, whose test functions still show the accelerations.

    An axis that is ramped up within a tenth of a second and then runs for seconds has a period of seconds:
    averaged over a quarter of it, the ramps are gone, and with them what tells inertia from friction. The
    averaging is shortened until it hides at most `MAX_HIDDEN_SHARE` of the mean square of inertia times
    acceleration over ever shorter spans, or where the force is predicted of that of the force, if it is more:
    of a drive that spins up friction takes nearly all, and the position follows from the rest.
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
    counted = whole
    if response is Response.FORCE:
        force = np.concatenate([record.force - record.force.mean() for record in records])
        counted = max(whole, float(np.mean(force**2)))
    hidden = whole - MAX_HIDDEN_SHARE * counted
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
        second = second[record.is_whole(span, span)[span:-span]]
        if not second.size:
            continue
        # What is left of a spike is a few large ones of them, and the finer the span the larger.
        second = np.minimum(np.abs(second), np.quantile(np.abs(second), LARGEST_ACCELERATION))
        scale = (record.inertia / (span * record.step_s) ** 2) ** 2
        total += scale * float(second @ second)
        gain = record.noise_gain(second_difference(span))
        noise += scale * gain * len(second) * record.noise[0] ** 2
        count += len(second)
    if not count or noise > MAX_NOISE_SHARE * total:
        return None
    return (total - noise) / count


def half_supports(record: UniformRecord, scale: MotionScale) -> tuple[int, int]:
    """Half support of a test function and of the smoothing of speeds [samples]."""
    half = min(_half_support(record, scale), len(record.position) // 8)
    widest = max(int(SPEED_SUPPORT_SHARE * half), MIN_SPEED_SUPPORT)
    narrow = MIN_SPEED_SUPPORT
    while narrow < widest and record.speed_noise(narrow) > MAX_SPEED_NOISE * scale.speed:
        narrow += 1
    return half, narrow


def _half_support(record: UniformRecord, scale: MotionScale) -> int:
    """Half of the least support at which a row's acceleration is quiet enough, or of the widest [samples]."""
    largest = 2.0 * math.pi * scale.speed / scale.period_s
    periods = PERIODS_PER_SUPPORT
    half = _half_of(periods, record, scale)
    for _ in range(0 if record.force.any() else WIDENINGS):
        _, curvature = test_function(half, record.step_s)
        if record.noise[0] * math.sqrt(record.noise_gain(curvature)) <= MAX_ACCELERATION_NOISE * largest:
            break
        periods *= WIDER
        half = _half_of(periods, record, scale)
    return half


def _half_of(periods: float, record: UniformRecord, scale: MotionScale) -> int:
    return max(int(0.5 * periods * scale.period_s / record.step_s), MIN_HALF_SUPPORT)


def widening(records: Sequence[UniformRecord], scale: MotionScale) -> float:
    """Mean of the supports over what they are where no noise makes them wider [1]."""
    least = 0.5 * PERIODS_PER_SUPPORT * scale.period_s
    wider = [half_supports(record, scale)[0] * record.step_s / least for record in records]
    return max(sum(wider) / len(wider), 1.0)


def is_told(record: UniformRecord, scale: MotionScale) -> NDArray[np.bool_]:
    """Whether what a row takes from about each sample was measured: no gap is near, shape (n,)."""
    half, narrow = half_supports(record, scale)
    reach = half + max(half // 2, 2 * narrow) + 2  # of a test function, and of loads and speeds within it
    return record.is_whole(reach, reach)


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
