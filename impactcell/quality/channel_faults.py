"""What a channel shows by itself: spikes, plateaus at its end, samples that are missing or stuck."""

import numpy as np
from numpy.typing import NDArray

from impactcell.features import is_command, white_noise_std
from impactcell.features.clipping import is_cut_off
from impactcell.numerics.raster import raster_of
from impactcell.numerics.spikes import noise_of, spike_samples
from impactcell.quality.data_fault import DataFault, Fault
from impactcell.records import Channel, Samples

MIN_PLATEAU = 5
"""Equal samples in a row that noise does not make."""
PLATEAU_FACTOR = 3.0
"""Length of a plateau over the longest run of equal samples elsewhere: a coarse raster makes runs
everywhere."""
MIN_STUCK = 10
"""Equal samples in a row, amid ones that differ, that are no measurement."""
TURN_STEPS = 3.0
"""Smallest steps within which a channel goes on after a run of equal samples where it turned or rested."""
SMALLEST = 0.05
"""Share of the steps from sample to sample that count as the smallest: one of the raster, rounded or not."""
GAP_FACTOR = 5.0
"""Step of time over the median one from which on samples are missing."""
MIN_SAMPLES = 16
"""Samples of a channel from which on any of this can be told."""


def channel_faults(name: str, channel: Channel, shot: int) -> list[DataFault]:
    """Say what is wrong with one channel of one shot."""
    if len(channel.values) < MIN_SAMPLES:
        return []
    if np.ptp(channel.values) == 0.0:
        told = f"the {name} is constant at {channel.values[0]:.6g}: not connected, or the wrong column"
        return [DataFault(Fault.CONSTANT, name, told, shot)]
    return [
        *_spikes(name, channel, shot),
        *_plateaus(name, channel, shot),
        *_gaps(name, channel, shot),
    ]


def ends_of_range(name: str, channel: Channel) -> tuple[float, ...]:
    """Values at which a channel is clipped."""
    return tuple(fault.end for fault in channel_faults(name, channel, 0) if fault.end is not None)


def _spikes(name: str, channel: Channel, shot: int) -> list[DataFault]:
    values = channel.values
    spikes = spike_samples(values)
    if not spikes.size:
        return []
    isolated = spikes[np.concatenate([[True], np.diff(spikes) > 1])]
    first = int(isolated[0])
    told = (
        f"{isolated.size} outliers in the {name}, the first at {channel.time_s[first]:.6g} s "
        f"({values[first]:.4g} amid "
        f"{float(np.median(values[max(first - 2, 0) : first + 3])):.4g}): check cable and shielding"
    )
    return [DataFault(Fault.OUTLIERS, name, told, shot)]


def _plateaus(name: str, channel: Channel, shot: int) -> list[DataFault]:
    values = channel.values
    if name == "actuator" or noise_of(values) == 0.0:
        return []  # an actuator halts, and without noise rest is a plateau
    if name == "force" and is_command(values):
        return []  # its levels are what was chosen
    starts, lengths = _equal_runs(values)
    # Where noise is less than a step of the raster, rest is a plateau too.
    is_coarse = (raster_of(values) or 0.0) > white_noise_std(values)
    if is_coarse and name != "force":
        return []
    data_faults = []
    extreme = np.isin(values[starts], (values.max(), values.min()))
    elsewhere = int(lengths[~extreme].max(initial=1))
    for end, word in ((float(values.max()), "upper"), (float(values.min()), "lower")):
        at_end = values[starts] == end
        longest = int(lengths[at_end].max(initial=0))
        if longest < MIN_PLATEAU or end == 0.0:
            continue
        if name == "force" and word == "upper":
            is_flat = is_cut_off(values, longest)
        else:
            is_flat = not is_coarse and longest > PLATEAU_FACTOR * elsewhere
        if is_flat:
            start = int(starts[at_end][lengths[at_end].argmax()])
            told = (
                f"the {name} stands at its {word} end, {end:.6g}, for {longest} samples from "
                f"{channel.time_s[start]:.6g} s "
                f"({int((values == end).sum())} in all): clipped; choose a wider range"
            )
            data_faults.append(DataFault(Fault.CLIPPING, name, told, shot, end))
    if is_coarse:
        return data_faults
    inner = ~extreme
    stuck = inner & (lengths >= MIN_STUCK) & (lengths > PLATEAU_FACTOR * np.median(lengths) + MIN_STUCK)
    stuck &= _goes_on_elsewhere(values[starts])
    stuck[0] = False  # a command that waits for its first step; nothing was lost before the record
    if stuck.any() and float(np.quantile(lengths, 0.9)) < 0.5 * MIN_STUCK:
        start = int(starts[stuck][0])
        told = (
            f"the {name} is stuck at {values[start]:.6g} for {int(lengths[stuck][0])} samples from "
            f"{channel.time_s[start]:.6g} s ({int(stuck.sum())} such stretches): samples were lost"
        )
        data_faults.append(DataFault(Fault.DROPOUTS, name, told, shot))
    return data_faults


def gaps_in_time(times: Samples) -> NDArray[np.intp]:
    """Give the places of the samples after which others are missing, by steps over the median one."""
    steps = np.diff(times)
    return np.flatnonzero(steps > GAP_FACTOR * np.median(steps))


def _gaps(name: str, channel: Channel, shot: int) -> list[DataFault]:
    steps, gaps = np.diff(channel.time_s), gaps_in_time(channel.time_s)
    if not gaps.size:
        return []
    first = int(gaps[0])
    places = "1 place" if gaps.size == 1 else f"{gaps.size} places"
    told = (
        f"samples of the {name} are missing in {places}, "
        f"the first for {1e3 * steps[first]:.3g} ms from "
        f"{channel.time_s[first]:.6g} s: what happened meanwhile is lost"
    )
    return [DataFault(Fault.DROPOUTS, name, told, shot)]


def _equal_runs(values: Samples) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Begin and length of each run of equal values."""
    starts = np.flatnonzero(np.concatenate([[True], np.diff(values) != 0.0]))
    return starts, np.diff(np.concatenate([starts, [len(values)]]))


def _goes_on_elsewhere(levels: Samples) -> NDArray[np.bool_]:
    """Whether a channel goes on far from where each run of equal samples stood: while stuck it went there.

    At the end of a swing a fine encoder shows as long a run, and goes on by a step of its raster.
    """
    ahead = np.abs(np.diff(levels, append=levels[-1]))
    return ahead > TURN_STEPS * float(np.quantile(ahead[:-1], SMALLEST))
