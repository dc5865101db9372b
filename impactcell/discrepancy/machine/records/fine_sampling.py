"""Records that are sampled coarsely for their motion, made finer: between samples they go as sine waves do.

Sums over samples stand for integrals, and a simulation takes the force straight from one sample to the next.
With few samples in a period of the fastest motion that errs by more than the sensors' noise, and what differs
from sample to sample is motion. What has no part above half the sampling rate is known between its samples,
too (Shannon, Proceedings of the IRE 37, 1949): such records are interpolated by a low pass of finite length.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import detrend, firwin, upfirdn, welch

from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.records import Samples

BANDS = 64
"""Into which the spectrum up to half the sampling rate is divided."""
LONG = 8 * BANDS
"""Samples of a record from which on they show its spectrum: three segments or more."""
QUIET_BANDS = 12
"""Highest ones, whose median is the density of the noise: a motion that reaches into most of them is lost."""
LOUD = 4.0
"""Density of a band with motion in it, over that of the noise."""
POWER_SHARE = 0.999
"""Share of the motion's power below its highest frequency."""
COARSE = 12.0
"""Samples in a period of the highest frequency below which a record is coarse [1]."""
FINE = 24.0
"""Samples in such a period that it is given: sums then err by less than a hundredth [1]."""
REACH = 16
"""Samples on either side by which one is interpolated, and which are lost at either end."""
ATTENUATION = 8.0
"""Of a Kaiser window: what lies beyond half the sampling rate is 80 dB down."""


def highest_frequency(values: Samples) -> tuple[float, float]:
    """Highest frequency of a motion in cycles a sample, and the standard deviation of white noise beside it.

    Both of the density in bands (Welch, 1967); a frequency of 0 where no band is louder than the noise.
    """
    frequency, density = welch(detrend(values), nperseg=4 * BANDS, window="blackmanharris")
    frequency, density = frequency[1:], density[1:]
    segments = 2 * len(values) // (4 * BANDS) - 1
    median_over_mean = (1.0 - 1.0 / (9.0 * segments)) ** 3  # of chi² with 2 degrees of freedom a segment
    noise = float(np.median(density[-2 * QUIET_BANDS :])) / median_over_mean
    power = np.where(density > LOUD * noise, density - noise, 0.0)
    if not power.any():
        return 0.0, math.sqrt(0.5 * noise)
    share = np.cumsum(power) / power.sum()
    return float(frequency[np.searchsorted(share, POWER_SHARE)]), math.sqrt(0.5 * noise)


def finely_sampled(records: Sequence[UniformRecord]) -> tuple[tuple[UniformRecord, ...], float]:
    """Give records with samples enough for their motion, and how many there were in its shortest period.

    Records come back as they are, with inf, where they are fine already or too short to tell, and where the
    drive is switched: its motion goes from switch to switch as no sine wave does.

    Noise that two samples share in part counts as white noise of the same density: rows average over it.
    """
    if any(record.force_is_command for record in records):
        return tuple(records), math.inf
    without_gaps = [record.position[record.longest_piece] for record in records]
    long = [position for position in without_gaps if len(position) >= LONG]
    fastest = max((highest_frequency(position)[0] for position in long), default=0.0)
    if fastest <= 1.0 / COARSE:
        return tuple(records), math.inf
    times = math.ceil(FINE * fastest)
    return tuple(_interpolated(record, times) for record in records), 1.0 / fastest


def _interpolated(record: UniformRecord, times: int) -> UniformRecord:
    low_pass = times * firwin(2 * REACH * times + 1, 1.0 / times, window=("kaiser", ATTENUATION))

    def between(values: Samples) -> Samples:
        inner = slice(2 * REACH * times, (len(values) - 1) * times + 1)  # what no end of the record touches
        return np.asarray(upfirdn(low_pass, values, times)[inner], dtype=np.float64)

    # A force between whose samples there are lines shows no noise at high frequencies.
    is_known = (
        record.noise_is_stated[0] or record.summed_up,
        record.noise_is_stated[1] or record.force_span > 1.0,
    )
    noise = [
        told if is_told or len(values) < LONG else min(told, highest_frequency(values)[1])
        for told, is_told, values in zip(
            record.noise,
            is_known,
            (record.position[record.longest_piece], record.force[record.longest_piece]),
            strict=True,
        )
    ]
    reach_s = 2 * REACH * record.step_s  # time begins later by half of it
    position, force = between(record.position), between(record.force)
    return replace(
        record,
        time_s=np.arange(float(len(position))) * (record.step_s / times),
        position=position,
        force=force,
        noise=(noise[0] * math.sqrt(times), noise[1] * math.sqrt(times)),
        finer=times,
        gaps=tuple((low - reach_s, high) for low, high in record.gaps),
    )
