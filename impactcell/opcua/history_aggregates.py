"""Aggregates of a stored series after OPC UA Part 13: Average, Minimum, Maximum and Count.

How values that are not Good are treated (Part 13, 4.2.1.2 and 5.4.3.1), with the defaults of this server in
brackets:

- Bad values never enter an aggregate.
- Uncertain values count as Bad (TreatUncertainAsBad true). With false they count as Good.
- All four are value based: of n values in the interval g are Good and b Bad. The result is Good where
  100 g/n reaches PercentDataGood (100), Bad where 100 b/n reaches PercentDataBad (100), and
  UncertainDataSubNormal in between.
- An interval without any value is BadNoData; for Count it is 0, unless it lies before the first or after
  the last
  stored value.
"""

import enum
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from impactcell.opcua.host_interface import HistoricalValue

RAW: Final = 0x400
CALCULATED: Final = 0x401
PARTIAL: Final = 0x404
MULTIPLE: Final = 0x410
"""Bits of a status code that tell where an aggregate comes from (Part 4, 7.39.2)."""

GOOD: Final = 0x0000_0000
SUB_NORMAL: Final = 0x40A4_0000
BAD: Final = 0x8000_0000
NO_DATA: Final = 0x809B_0000


SEVERITY_SHIFT: Final = 30
SEVERITY_GOOD: Final = 0b00
SEVERITY_UNCERTAIN: Final = 0b01
"""The two uppermost bits of a status code (Part 4, 7.39.1)."""


class Aggregate(enum.Enum):
    """Aggregates this server computes."""

    AVERAGE = "Average"
    MINIMUM = "Minimum"
    MAXIMUM = "Maximum"
    COUNT = "Count"


@dataclass(frozen=True, slots=True)
class Treatment:
    """AggregateConfiguration of Part 13."""

    uncertain_as_bad: bool = True
    percent_bad: int = 100
    percent_good: int = 100


@dataclass(frozen=True, slots=True)
class Interval:
    """A processing interval from `start_ns`, which belongs to it, to `end_ns`, which does not.

    Where time runs backwards `start_ns` is the later one. `partial` is True where the interval is shorter
    than asked for.
    """

    start_ns: int
    end_ns: int
    partial: bool = False

    def __contains__(self, time_ns: int) -> bool:
        if self.start_ns <= self.end_ns:
            return self.start_ns <= time_ns < self.end_ns
        return self.end_ns < time_ns <= self.start_ns


@dataclass(frozen=True, slots=True)
class Processed:
    """An aggregate of one interval; `status` is an OPC UA status code, `value` None where there is none."""

    time_ns: int
    value: float | int | None
    status: int


def intervals(start_ns: int, end_ns: int, step_ns: int) -> Iterator[Interval]:
    """Cut a span into processing intervals; a step of 0 leaves it whole.

    >>> [(i.start_ns, i.end_ns, i.partial) for i in intervals(0, 25, 10)]
    [(0, 10, False), (10, 20, False), (20, 25, True)]
    >>> [(i.start_ns, i.end_ns, i.partial) for i in intervals(20, 0, 10)]
    [(20, 10, False), (10, 0, False)]
    """
    sign = 1 if end_ns >= start_ns else -1
    step = sign * step_ns if step_ns else end_ns - start_ns
    at = start_ns
    while sign * (end_ns - at) > 0:
        stop = at + step
        partial = sign * (stop - end_ns) > 0
        yield Interval(at, end_ns if partial else stop, partial)
        at = stop


def process(
    aggregate: Aggregate,
    interval: Interval,
    values: Sequence[HistoricalValue],
    treatment: Treatment,
    *,
    within: bool,
) -> Processed:
    """Aggregate the values of one interval.

    Parameters
    ----------
    values : sequence of HistoricalValue
        All that lie in the interval, in any order.
    within : bool
        Whether the interval touches the span of what is stored at all.
    """
    if aggregate is Aggregate.COUNT:
        return _count(interval, values, treatment, within=within)
    good = [value for value in values if _is_good(value, treatment)]
    if not good:
        return Processed(interval.start_ns, None, NO_DATA if not values else BAD)
    status = _status(len(good), len(values), treatment)
    if aggregate is Aggregate.AVERAGE:
        mean = sum(value.value for value in good) / len(good)
        return Processed(interval.start_ns, mean, status | CALCULATED)
    pick = min if aggregate is Aggregate.MINIMUM else max
    return _extreme(pick, interval, values, good, status)


def _count(
    interval: Interval, values: Sequence[HistoricalValue], treatment: Treatment, *, within: bool
) -> Processed:
    bits = CALCULATED | (PARTIAL if interval.partial else 0)
    if not values:
        return (
            Processed(interval.start_ns, 0, bits) if within else Processed(interval.start_ns, None, NO_DATA)
        )
    good = sum(1 for value in values if _is_good(value, treatment))
    return Processed(interval.start_ns, good, _status(good, len(values), treatment) | bits)


def _extreme(
    pick: Callable[..., float],
    interval: Interval,
    values: Sequence[HistoricalValue],
    good: Sequence[HistoricalValue],
    status: int,
) -> Processed:
    found = pick(value.value for value in good)
    at = [value.time_ns for value in good if value.value == found]
    if any(pick(value.value, found) != found for value in values if value not in good):
        # Part 13, 5.4.3.10: a more extreme value exists that is not Good.
        status = max(status, SUB_NORMAL)
    bits = RAW if interval.start_ns in at else CALCULATED
    bits |= (MULTIPLE if len(at) > 1 else 0) | (PARTIAL if interval.partial else 0)
    return Processed(interval.start_ns, found, status | bits)


def _is_good(value: HistoricalValue, treatment: Treatment) -> bool:
    severity = value.status >> SEVERITY_SHIFT
    return severity == SEVERITY_GOOD or (severity == SEVERITY_UNCERTAIN and not treatment.uncertain_as_bad)


def _status(good: int, all_values: int, treatment: Treatment) -> int:
    percent_good = 100.0 * good / all_values
    if percent_good >= treatment.percent_good:
        return GOOD
    if 100.0 - percent_good >= treatment.percent_bad:
        return BAD
    return SUB_NORMAL
