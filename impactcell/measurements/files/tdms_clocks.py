"""Times of the channels of a TDMS file: each its own, all counted from one moment where one is told."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from impactcell.errors import MeasurementError
from impactcell.measurements.columns.recognition import WORD_MATCH, ColumnMeaning, name_score

UNSET = np.datetime64("1904-01-02")
"""LabVIEW counts moments from 1904-01-01; a waveform that begins there was never told its moment."""
SECOND = np.timedelta64(10**9, "ns")

Moment = np.datetime64
Columns = list[tuple[str, str | None, Any]]


@dataclass(slots=True)
class _Run:
    """What was recorded together: names of its channels, when they begin, the stretch that they cover."""

    names: set[str] = field(default_factory=set)
    starts: list[Moment] = field(default_factory=list)
    spans: list[tuple[Moment, Moment]] = field(default_factory=list)
    without_start: list[str] = field(default_factory=list)

    def is_followed_by(self, other: "_Run") -> bool:
        """Whether the other repeats channels of this one, and at another time, if times are told."""
        if not self.names & other.names:
            return False
        if not self.spans or not other.spans:
            return True
        (first, last), (begin, end) = self.stretch(), other.stretch()
        return bool(end <= first or begin >= last)

    def stretch(self) -> tuple[Moment, Moment]:
        """First and last moment, of a run that has any."""
        return min(first for first, _ in self.spans), max(last for _, last in self.spans)

    def add(self, other: "_Run") -> None:
        """Take what was recorded at the same time."""
        self.names |= other.names
        self.starts += other.starts
        self.spans += other.spans
        self.without_start += other.without_start


def origins(path: Path, groups: Sequence[Any]) -> list[Moment | None]:
    """Give the moment from which the times of each group count: the earliest of what was recorded with it.

    A group that has the channels of those before once more, at another time, is a recording of its own.

    Raises
    ------
    MeasurementError
        Channels that were recorded together begin at different moments, and one does not say at which.
    """
    runs: list[_Run] = []
    of_groups: list[_Run] = []
    for group in groups:
        own = _run(group)
        if not runs or runs[-1].is_followed_by(own):
            runs.append(_Run())
        runs[-1].add(own)
        of_groups.append(runs[-1])
    for run in runs:
        if run.without_start and len(set(run.starts)) > 1:
            raise MeasurementError(
                f"{path}: {run.without_start[0]} does not say at which moment it begins, where others of the "
                f"file begin at different ones; give it its wf_start_time, or export all with one time"
            )
    return [min(run.starts, default=None) for run in of_groups]


def by_clock(channels: Sequence[Any], origin: Moment | None) -> Iterator[tuple[Columns, list[Any]]]:
    """Give the channels that share their times, after the column of these where waveforms say them."""
    for length in dict.fromkeys(len(channel) for channel in channels if len(channel)):
        same = [channel for channel in channels if len(channel) == length]
        clocks = [_clock(channel, origin) for channel in same]
        told = [clock for clock in dict.fromkeys(clocks) if clock is not None]
        for clock in told:
            begin, step = clock
            with_it = [c for c, own in zip(same, clocks, strict=True) if own == clock]
            yield [("time", "s", begin + step * np.arange(length))], same if len(told) == 1 else with_it
        if len(told) != 1 and None in clocks:
            yield [], [c for c, own in zip(same, clocks, strict=True) if own is None]


def _clock(channel: Any, origin: Moment | None) -> tuple[float, float] | None:
    """Give the first time of a waveform and its step [s], None for a channel that is none."""
    step = _step(channel)
    if step is None:
        return None
    start = _start(channel)
    begin = 0.0 if start is None or origin is None else float((start - origin) / SECOND)
    return begin + _offset(channel), step


def _run(group: Any) -> _Run:
    run = _Run()
    for channel in group.channels():
        if not len(channel):
            continue
        step, start = _step(channel), _start(channel)
        is_time = name_score(channel.name, ColumnMeaning.TIME)[0] >= WORD_MATCH
        if np.dtype(channel.dtype).kind == "M":
            if channel[-1] > channel[0]:
                run.starts.append(_exact(channel[0]))
                run.spans.append((_exact(channel[0]), _exact(channel[-1])))
            continue  # recordings of one time may call it the same
        if step is not None and start is not None:
            first, length = _offset(channel), step * len(channel)
            run.starts.append(start)
            run.spans.append((start + _duration(first), start + _duration(first + length)))
        elif step is not None:
            run.without_start.append(f"channel {channel.name!r} of group {group.name!r}")
        if not is_time:
            run.names.add(channel.name)
    if not run.starts and not run.without_start:
        run.without_start += [
            f"channel {channel.name!r} of group {group.name!r}"
            for channel in group.channels()
            if len(channel) > 1 and name_score(channel.name, ColumnMeaning.TIME)[0] >= WORD_MATCH
        ]
    return run


def _step(channel: Any) -> float | None:
    return float(channel.properties.get("wf_increment") or 0.0) or None


def _offset(channel: Any) -> float:
    return float(channel.properties.get("wf_start_offset") or 0.0)


def _start(channel: Any) -> Moment | None:
    start = channel.properties.get("wf_start_time")
    return _exact(start) if isinstance(start, np.datetime64) and start > UNSET else None


def _exact(moment: Moment) -> Moment:
    exact: Moment = moment.astype("datetime64[ns]")
    return exact


def _duration(seconds: float) -> np.timedelta64:
    return np.timedelta64(round(1e9 * seconds), "ns")
