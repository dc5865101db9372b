"""ReadProcessedDetails: aggregates of a stored series, interval by interval (Part 11, 6.5.4)."""

from collections import deque
from dataclasses import replace
from typing import Final

from asyncua import ua

from impactcell.opcua.address_space.variable_store import nanoseconds
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.history.historical_variable import (
    BEGINNING,
    VALUES_PER_PAGE,
    HistoricalVariable,
    ReadRange,
)
from impactcell.opcua.history.history_aggregates import (
    AggregateConfiguration,
    AggregateFunction,
    AggregateValue,
    IntervalAggregate,
    ProcessingInterval,
    processing_intervals,
)
from impactcell.opcua.history.read_budget import ReadBudget
from impactcell.opcua.host_interface import HistoricalValue

MAX_INTERVALS: Final = 1_000_000
"""Processing intervals in one request, over all its pages."""

AGGREGATE_FUNCTIONS: Final = {
    ua.NodeId(ua.ObjectIds.AggregateFunction_Average): AggregateFunction.AVERAGE,
    ua.NodeId(ua.ObjectIds.AggregateFunction_Minimum): AggregateFunction.MINIMUM,
    ua.NodeId(ua.ObjectIds.AggregateFunction_Maximum): AggregateFunction.MAXIMUM,
    ua.NodeId(ua.ObjectIds.AggregateFunction_Count): AggregateFunction.COUNT,
}


class ProcessedReading:
    """Aggregates of one variable, as far as they have been read: once through the values, in their order.

    Between two answers it holds one aggregate that may be half done, and no values.

    Raises
    ------
    StatusCodeError
        BadAggregateNotSupported, BadAggregateInvalidInputs, BadAggregateConfigurationRejected or
        BadInvalidTimestampArgument.
    """

    def __init__(self, series: HistoricalVariable, details: ua.ReadProcessedDetails, kind: ua.NodeId) -> None:
        function = AGGREGATE_FUNCTIONS.get(kind)
        if function is None:
            raise StatusCodeError(ua.StatusCodes.BadAggregateNotSupported)
        self.is_count = function is AggregateFunction.COUNT
        self._series, self._function = series, function
        self._configuration = _configuration(details.AggregateConfiguration)
        start_ns, end_ns, step_ns = _span(details)
        self._intervals = processing_intervals(start_ns, end_ns, step_ns)
        self._whole = ReadRange(min(start_ns, end_ns), max(start_ns, end_ns), newest_first=start_ns > end_ns)
        self._unread: ReadRange | None = self._whole
        self._ahead: deque[HistoricalValue] = deque()
        self._aggregate: IntervalAggregate | None = self._next()
        self._ends: tuple[int, int] | None = None
        self._ends_known = False

    @property
    def is_finished(self) -> bool:
        """Whether all intervals have been answered."""
        return self._aggregate is None

    async def read(self, budget: ReadBudget) -> list[AggregateValue]:
        """Read what one answer holds."""
        limit, results = budget.room(VALUES_PER_PAGE), list[AggregateValue]()
        while self._aggregate is not None and len(results) < limit:
            if not self._ahead and self._unread is not None:
                if budget.is_spent:
                    break
                values, self._unread = await self._series.page(self._unread)
                self._ahead.extend(values)
                await budget.spend(0)
                continue
            while self._ahead and not _is_beyond(self._ahead[0], self._aggregate.interval):
                self._aggregate.add(self._ahead.popleft())
            if self._ahead or self._unread is None:
                results.append(self._aggregate.result(within=await self._is_within(self._aggregate)))
                self._aggregate = self._next()
                await budget.spend(1)
        self._put_back()
        return results

    def _next(self) -> IntervalAggregate | None:
        interval = next(self._intervals, None)
        return None if interval is None else IntervalAggregate(self._function, interval, self._configuration)

    def _put_back(self) -> None:
        """Leave values that belong to later intervals to be read again: all of one time are among them."""
        if self._ahead:
            time_ns, whole = self._ahead[0].time_ns, self._whole
            self._unread = (
                replace(whole, end_ns=time_ns) if whole.newest_first else replace(whole, start_ns=time_ns)
            )
            self._ahead.clear()

    async def _is_within(self, aggregate: IntervalAggregate) -> bool:
        """Whether an interval touches the span of what is stored; asked only where it makes a difference."""
        if aggregate.count or not self.is_count:
            return True
        if not self._ends_known:
            self._ends, self._ends_known = await self._series.ends(), True
        interval = aggregate.interval
        low, high = sorted((interval.start_ns, interval.end_ns))
        return self._ends is not None and high > self._ends[0] and low <= self._ends[1]


def _span(details: ua.ReadProcessedDetails) -> tuple[int, int, int]:
    """Read start, end and length of an interval, nanoseconds."""
    if min(details.StartTime, details.EndTime) <= BEGINNING or details.StartTime == details.EndTime:
        raise StatusCodeError(ua.StatusCodes.BadInvalidTimestampArgument)
    if not 0.0 <= details.ProcessingInterval < 1e15:
        raise StatusCodeError(ua.StatusCodes.BadAggregateInvalidInputs)
    start_ns, end_ns = nanoseconds(details.StartTime), nanoseconds(details.EndTime)
    step_ns = int(details.ProcessingInterval * 1e6)
    if step_ns and abs(end_ns - start_ns) // step_ns > MAX_INTERVALS:
        raise StatusCodeError(ua.StatusCodes.BadAggregateInvalidInputs)
    return start_ns, end_ns, step_ns


def _is_beyond(value: HistoricalValue, interval: ProcessingInterval) -> bool:
    """Whether a value comes after an interval, in the direction of the intervals."""
    if interval.start_ns <= interval.end_ns:
        return value.time_ns >= interval.end_ns
    return value.time_ns <= interval.end_ns


def _configuration(requested: ua.AggregateConfiguration) -> AggregateConfiguration:
    if requested.UseServerCapabilitiesDefaults:
        return AggregateConfiguration()
    bad, good = requested.PercentDataBad, requested.PercentDataGood
    if bad > 100 or good > 100 or bad + good < 100:
        raise StatusCodeError(ua.StatusCodes.BadAggregateConfigurationRejected)
    return AggregateConfiguration(requested.TreatUncertainAsBad, bad, good)
