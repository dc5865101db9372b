"""Finds where contact begins in a record of force, cuts a long record into taps, and puts t = 0 there."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from impactcell.numerics.spikes import NORMAL_SCALE, noise_of
from impactcell.records import Samples

THRESHOLD_STD = 6.0
"""Force of a contact in standard deviations of a sample: noise alone passes it once in 1e9 samples."""
THRESHOLD_SHARE = 0.01
"""Force of a contact as a share of the largest: what a sensor creeps is less."""
CONFIRMING_SAMPLES = 3
"""Samples in a row above the threshold: a spike of one or two samples is no contact."""
SHOT_GAP_S = 0.2
"""Time without contact after which a new tap begins; a part slides for 30 to 120 ms, and may be struck
again meanwhile."""
REST_S = 0.05
"""Time kept before a contact, and at the end of the slide."""
SYNCHRONOUS_SHARE = 0.5
"""Spread of the onsets in sampling steps below which sampling was started by the tap itself: where in the
step it
then begins cannot be told. Four onsets anywhere in the step are that close once in three times, eight once
in 30."""

RESTING_PART, QUARTER_SCALE = 4, 3.14
"""Part of the samples that are looked for where they lie closest, a quarter, and the standard deviation of a
normal distribution over half the width that holds a quarter of it."""
RESTING_STD = 4.0
"""Standard deviations about them within which samples count as resting: noise leaves 6 in 1e5 out."""


@dataclass(frozen=True, slots=True)
class Baseline:
    """Force without contact [N]: its value, the noise of a sample, the threshold of contact above it."""

    offset: float
    noise_std: float
    threshold: float


def pulse_sign(values: Samples, rest: float | None = None) -> int:
    """Sign of a contact force, or of a motion: that of the larger excursion from rest, else the median."""
    middle = float(np.median(values)) if rest is None else rest
    low, high = extremes(values)
    return 1 if high - middle >= middle - low else -1


def extremes(values: Samples) -> tuple[float, float]:
    """Smallest and largest value that lasts for as many samples as a contact: a spike is neither."""
    lasting = median_filter(values, 2 * CONFIRMING_SAMPLES - 1, mode="nearest")
    return float(lasting.min()), float(lasting.max())


def baseline_of(force: Samples, threshold_n: float | None = None) -> Baseline:
    """Force without contact: the median of the samples among which the force rests.

    It rests where a quarter of the samples in the lower half of its range lie closest together (a shorth,
    Andrews et al. 1972), and as far around as noise goes: a contact that takes half of the record and rises
    slowly is no noise.
    """
    low, high = extremes(force)
    resting = np.sort(force[force <= 0.5 * (low + high)])
    count = len(resting) // RESTING_PART
    noise = noise_of(force)
    if count:
        widths = resting[count:] - resting[:-count]
        first = int(widths.argmin())
        middle = 0.5 * float(resting[first] + resting[first + count])
        reach = RESTING_STD * max(QUARTER_SCALE * 0.5 * float(widths[first]), noise)
        resting = resting[np.abs(resting - middle) <= reach]
    offset = float(np.median(resting))
    if len(resting) > 10:
        noise = max(noise, float(NORMAL_SCALE * np.median(np.abs(resting - offset))))
    if threshold_n is None:
        threshold_n = max(THRESHOLD_STD * noise, THRESHOLD_SHARE * (high - offset))
    return Baseline(offset, noise, threshold_n)


def contact_onsets(time: Samples, force: Samples, baseline: Baseline, gap_s: float = SHOT_GAP_S) -> list[int]:
    """Index of the first sample of each tap's first contact, which no other precedes by less than the gap.

    A spike is no contact, and hides none after it.
    """
    above = force - baseline.offset > baseline.threshold
    run = above.copy()
    for step in range(1, CONFIRMING_SAMPLES):
        run[:-step] &= above[step:]
    starts = np.flatnonzero(run & ~np.concatenate([[False], run[:-1]]))
    onsets: list[int] = []
    touching = np.flatnonzero(np.convolve(run, np.ones(CONFIRMING_SAMPLES))[: len(run)] > 0.0)
    for start in starts.tolist():
        earlier = touching[touching < start]
        is_new = not earlier.size or time[start] - time[earlier[-1]] > gap_s
        if is_new:
            onsets.append(start)
    return onsets


def rest_end(time: Samples, position: Samples, from_s: float) -> float:
    """Time at which the part has been at rest for `REST_S` after `from_s`; the last one if it never is."""
    after = np.flatnonzero(time >= from_s)
    if len(after) < 10:
        return float(time[-1])
    step = float(np.median(np.diff(time)))
    width = max(3, round(REST_S / step))
    band = 8.0 * max(noise_of(position), 1e-9)
    moving_from = float(position[after[0]])
    for begin in range(int(after[0]), len(time) - width, max(1, width // 4)):
        stretch = position[begin : begin + width]
        if np.ptp(stretch) < band and abs(float(np.median(stretch)) - moving_from) > band:
            return float(time[begin + width - 1])
    return float(time[-1])


def onset_within_sample(
    time: list[Samples], force: list[Samples], onsets: list[int], velocities: list[float]
) -> list[float]:
    """Time of first contact of each tap [s], between the last sample without and the first with contact.

    While the part still sticks F = b v + k v (t - t0). A line through the first samples of contact gives k v
    and, at the first of them, b v + k v delta with delta the time since contact, anywhere within a step. Over
    the taps the smallest of (b v + k v delta) / v is b, so each delta follows; with fewer than four taps, or
    where this does not hold, it is half a step, and about half a step where all are nearly the same.

    Parameters
    ----------
    time, force : list of ndarray
        Of each tap, s and N without offset.
    onsets : list of int
        First sample of contact; at least one without contact comes before it.
    velocities : list of float
        Of the actuator, m/s.
    """
    intercepts, slopes, steps = [], [], []
    for t, f, i, v in zip(time, force, onsets, velocities, strict=True):
        stretch = slice(i, i + 4)
        slope, value = (
            np.polyfit(t[stretch] - t[i], f[stretch], 1) if len(t[stretch]) == 4 else (np.nan, np.nan)
        )
        intercepts.append(value / v)
        slopes.append(slope / v)
        steps.append(t[i] - t[i - 1])
    b, k, step = float(np.min(intercepts)), float(np.median(slopes)), float(np.median(steps))
    deltas = (np.array(intercepts) - b) / k if k > 0.0 else np.full(len(steps), np.nan)
    if len(steps) < 4 or not np.all(np.isfinite(deltas)) or deltas.max() > 1.5 * step:
        return [float(t[i] - 0.5 * s) for t, i, s in zip(time, onsets, steps, strict=True)]
    if deltas.max() < SYNCHRONOUS_SHARE * step:
        deltas = deltas - deltas.mean() + 0.5 * step
    else:
        deltas = np.minimum(deltas + step / (len(steps) + 1), step)
    return [float(t[i] - delta) for t, i, delta in zip(time, onsets, deltas.tolist(), strict=True)]
