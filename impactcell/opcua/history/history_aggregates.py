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
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from impactcell.opcua.host_interface import HistoricalValue

RAW: Final = 0x400
"""The result is a stored value (the info bits of an aggregate, Part 4, 7.39.2)."""
CALCULATED: Final = 0x401
"""It was computed."""
PARTIAL: Final = 0x404
"""The interval is shorter than was asked for."""
MULTIPLE: Final = 0x410
"""The extreme occurs more than once."""

GOOD: Final = 0x0000_0000
"""Status code Good (Part 6, annex A, as the three that follow)."""
SUB_NORMAL: Final = 0x40A4_0000
"""UncertainDataSubNormal: some values were left out."""
BAD: Final = 0x8000_0000
"""Bad: no value could be used."""
NO_DATA: Final = 0x809B_0000
"""BadNoData: there was no value."""
SEVERITY_SHIFT: Final = 30
"""Lowest of the two bits of a status code that tell its severity (Part 4, 7.39.1)."""
SEVERITY_GOOD: Final = 0b00
"""Severity Good."""
SEVERITY_UNCERTAIN: Final = 0b01
"""Severity Uncertain."""


class AggregateFunction(enum.Enum):
    """Aggregates this server computes."""

    AVERAGE = "Average"
    MINIMUM = "Minimum"
    MAXIMUM = "Maximum"
    COUNT = "Count"


@dataclass(frozen=True, slots=True)
class AggregateConfiguration:
    """AggregateConfiguration of Part 13."""

    uncertain_as_bad: bool = True
    percent_bad: int = 100
    percent_good: int = 100


@dataclass(frozen=True, slots=True)
class ProcessingInterval:
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
class AggregateValue:
    """An aggregate of one interval; `status` is an OPC UA status code, `value` None where there is none."""

    time_ns: int
    value: float | int | None
    status: int


def processing_intervals(start_ns: int, end_ns: int, step_ns: int) -> Iterator[ProcessingInterval]:
    """Cut a span into processing intervals; a step of 0 leaves it whole.

    >>> [(i.start_ns, i.end_ns, i.partial) for i in processing_intervals(0, 25, 10)]
    [(0, 10, False), (10, 20, False), (20, 25, True)]
    >>> [(i.start_ns, i.end_ns, i.partial) for i in processing_intervals(20, 0, 10)]
    [(20, 10, False), (10, 0, False)]
    """
    sign = 1 if end_ns >= start_ns else -1
    step = sign * step_ns if step_ns else end_ns - start_ns
    lower_ns = start_ns
    while sign * (end_ns - lower_ns) > 0:
        upper_ns = lower_ns + step
        partial = sign * (upper_ns - end_ns) > 0
        yield ProcessingInterval(lower_ns, end_ns if partial else upper_ns, partial)
        lower_ns = upper_ns


class IntervalAggregate:
    """The aggregate of one interval, from its values one after the other, in any order.

    It holds no values: its size, and the cost of one more, do not depend on how many there are.
    """

    def __init__(
        self,
        aggregate: AggregateFunction,
        interval: ProcessingInterval,
        configuration: AggregateConfiguration,
    ) -> None:
        self.interval = interval
        self.count = 0
        self._aggregate = aggregate
        self._configuration = configuration
        self._pick = min if aggregate is AggregateFunction.MINIMUM else max
        self._good = 0
        self._sum = 0.0
        self._extreme = self._extreme_not_good = math.nan
        self._occurrences = 0
        self._occurs_at_start = False
        self._has_missing = False

    def add(self, value: HistoricalValue) -> None:
        """Take in a value that lies in the interval."""
        self.count += 1
        if _is_good(value, self._configuration):
            self._good += 1
            self._sum += value.value or 0.0
            self._add_good(value.value or 0.0, value.time_ns)
        elif value.value is None or math.isnan(value.value):
            self._has_missing = True
        else:
            self._extreme_not_good = self._more_extreme(value.value, self._extreme_not_good)

    def _add_good(self, value: float, time_ns: int) -> None:
        if value != self._extreme:
            if self._more_extreme(value, self._extreme) != value:
                return
            self._extreme, self._occurrences, self._occurs_at_start = value, 0, False
        self._occurrences += 1
        self._occurs_at_start |= time_ns == self.interval.start_ns

    def _more_extreme(self, value: float, other: float) -> float:
        return value if math.isnan(other) else self._pick(value, other)

    def result(self, *, within: bool) -> AggregateValue:
        """Give the aggregate.

        Parameters
        ----------
        within : bool
            Whether the interval touches the span of what is stored at all.
        """
        start_ns, partial = self.interval.start_ns, PARTIAL if self.interval.partial else 0
        if self._aggregate is AggregateFunction.COUNT:
            if not self.count and not within:
                return AggregateValue(start_ns, None, NO_DATA)
            return AggregateValue(start_ns, self._good, self._status() | CALCULATED | partial)
        if not self._good:
            return AggregateValue(start_ns, None, BAD if self.count else NO_DATA)
        if self._aggregate is AggregateFunction.AVERAGE:
            return AggregateValue(start_ns, self._sum / self._good, self._status() | CALCULATED)
        status = self._status()
        if self._has_missing or self._more_extreme(self._extreme, self._extreme_not_good) != self._extreme:
            # Part 13, 5.4.3.10: a more extreme value exists that is not Good.
            status = max(status, SUB_NORMAL)
        bits = RAW if self._occurs_at_start else CALCULATED
        return AggregateValue(
            start_ns, self._extreme, status | bits | partial | (MULTIPLE if self._occurrences > 1 else 0)
        )

    def _status(self) -> int:
        return _status(self._good, self.count, self._configuration) if self.count else GOOD


def _is_good(value: HistoricalValue, configuration: AggregateConfiguration) -> bool:
    severity = value.status >> SEVERITY_SHIFT
    return severity == SEVERITY_GOOD or (
        severity == SEVERITY_UNCERTAIN and not configuration.uncertain_as_bad
    )


def _status(good: int, all_values: int, configuration: AggregateConfiguration) -> int:
    percent_good = 100.0 * good / all_values
    if percent_good >= configuration.percent_good:
        return GOOD
    if 100.0 - percent_good >= configuration.percent_bad:
        return BAD
    return SUB_NORMAL
