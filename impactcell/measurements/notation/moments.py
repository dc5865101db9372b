"""Moments as people write them: dates and clock times as seconds from the first, where one reading fits."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date

import numpy as np

from impactcell.measurements.notation.numbers import is_missing
from impactcell.records import Samples

DAY_S = 86_400.0
"""Seconds of a day."""
EPOCH = np.datetime64("1970-01-01", "ns")
"""Day of a time that is written without one."""
_CLOCK = (
    r"(?P<hour>\d{1,2}):(?P<minute>\d{2})(?::(?P<second>\d{2}(?:[.,;]\d+)?))?(?:\s*(?P<half>[AaPp])[Mm])?"
)
_BEFORE_CLOCK = r",?[T ]+"
_ZONE = r"(?:Z|(?P<ahead>[+-])(?P<zone_hour>\d{2})(?::?(?P<zone_minute>\d{2}))?)?"
"""How far a clock is ahead of UTC: what is written without is not known, and taken as it is."""
_TWO = r"(\d{1,2})"
_DATES = (
    (r"(?P<date>(\d{4})(?P<mark>[-/.])" + _TWO + r"(?P=mark)" + _TWO + ")", ("ymd",)),
    (r"(?P<date>" + _TWO + r"\." + _TWO + r"\.(\d{4}|\d{2}))", ("dmy",)),
    (r"(?P<date>" + _TWO + r"(?P<mark>[-/])" + _TWO + r"(?P=mark)(\d{4}))", ("dmy", "mdy")),
    (r"(?P<date>" + _TWO + r"(?P<mark>[-/])" + _TWO + r"(?P=mark)(\d{2}))", ("dmy", "mdy", "ymd")),
)
"""Writings of a date, and the orders in which year, month and day may stand in each."""


@dataclass(frozen=True, slots=True, eq=False)
class Moments:
    """A column of dates or clock times.

    Attributes
    ----------
    seconds : ndarray, shape (n,)
        From the first.
    begun : datetime64
        The first, by UTC where cells say their zone; of 1 January 1970 where no day is written.
    """

    seconds: Samples
    begun: np.datetime64


def read_moments(cells: Sequence[str]) -> Moments | None:
    """Give the moments of a column of dates or clock times; None where it is none.

    A date with dots begins with its day. One with strokes is read where one order alone fits all cells, as a
    day above 12 has it, or where all orders say the same, as within one day. What cells say of their zone
    counts, as where clocks are put forward; a clock without a date that falls by half a day goes over
    midnight.

    >>> read_moments(["31/01/2024 23:59:59", "01/02/2024 00:00:01"]).seconds
    array([0., 2.])
    >>> read_moments(["2024-03-31T01:59:59+01:00", "2024-03-31T03:00:00+02:00"]).seconds
    array([0., 1.])
    >>> read_moments(["23:59:59", "00:00:01"]).seconds
    array([0., 2.])
    >>> read_moments(["05/01/2024 23:59:59", "06/01/2024 00:00:01"]) is None
    True
    """
    readings = _readings(cells)
    return readings[0] if len(readings) == 1 else None


def unread_moments(cells: Sequence[str]) -> tuple[str, str]:
    """Say what keeps a column of dates from being a time, and what to do; empty where it is none of dates."""
    if len(_readings(cells)) > 1:
        return "dates of which day and month can be either", "write them all as 2024-01-31 10:00:00.000"
    filled = [cell for cell in cells if not is_missing(cell)]
    if filled and all(any(re.fullmatch(pattern, cell) for pattern, _ in _DATES) for cell in filled):
        return (
            "days without a time of day",
            "export hours, minutes and fractions of a second with each sample",
        )
    return "", ""


def _readings(cells: Sequence[str]) -> list[Moments]:
    """Give each reading of a column under which all of its cells are moments; those that agree once."""
    if not cells:
        return []
    clock = _matches(_CLOCK, cells)
    if clock:
        seconds = np.array([_second_of_day(match) for match in clock])
        seconds[1:] += DAY_S * np.cumsum(np.diff(seconds) < -0.5 * DAY_S)
        return [_moments(0.0, seconds)]
    for pattern, orders in _DATES:
        matches = _matches(pattern + _BEFORE_CLOCK + _CLOCK + _ZONE, cells)
        if not matches:
            continue
        seconds = np.array([_second_of_day(match) - _ahead_s(match) for match in matches])
        readings: list[Moments] = []
        for order in orders:
            days = {text: _ordinal(order, text) for text in {match["date"] for match in matches}}
            passed = np.array([days[match["date"]] for match in matches])
            if not np.isfinite(passed).all():
                continue
            reading = _moments(passed[0], DAY_S * (passed - passed[0]) + seconds)
            if not any(np.array_equal(reading.seconds, one.seconds) for one in readings):
                readings.append(reading)
        return readings
    return []


def _moments(day: float, seconds: Samples) -> Moments:
    """Give moments by the first's day, counted from 1970, and seconds from that day's begin."""
    since = np.timedelta64(round(1e9 * seconds[0]), "ns") + np.timedelta64(int(day), "D")
    return Moments(np.round(seconds - seconds[0], 9), EPOCH + since)


def _matches(pattern: str, cells: Sequence[str]) -> list[re.Match[str]]:
    """Give the match of each cell; none where one does not fit."""
    compiled = re.compile(pattern)
    found = []
    for cell in cells:
        match = compiled.fullmatch(cell)
        if match is None:
            return []
        found.append(match)
    return found


def _ordinal(order: str, text: str) -> float:
    """Give the number of a day, counted from 1970; nan where there is no such day."""
    of = {name: int(part) for name, part in zip(order, re.split(r"[-/.]", text), strict=True)}
    try:
        return float(
            date(of["y"] if of["y"] > 99 else 2000 + of["y"], of["m"], of["d"]).toordinal()
            - date(1970, 1, 1).toordinal()
        )
    except ValueError:
        return np.nan


def _second_of_day(match: re.Match[str]) -> float:
    hour = int(match["hour"])
    if match["half"] is not None:
        hour = hour % 12 + (12 if match["half"] in "Pp" else 0)
    return 3600.0 * hour + 60.0 * int(match["minute"]) + float(re.sub("[,;]", ".", match["second"] or "0"))


def _ahead_s(match: re.Match[str]) -> float:
    """How far the clock of a cell is ahead of UTC [s]; 0 where it does not say."""
    if match["ahead"] is None:
        return 0.0
    ahead = 3600.0 * int(match["zone_hour"]) + 60.0 * int(match["zone_minute"] or 0)
    return -ahead if match["ahead"] == "-" else ahead
