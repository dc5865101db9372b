"""ReadProcessedDetails: aggregates of a stored series, interval by interval (Part 11, 6.5.4)."""

from typing import Final

from asyncua import ua

from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.historical_variable import BEGINNING, VALUES_PER_PAGE, HistoricalVariable, ReadRange
from impactcell.opcua.history_aggregates import (
    AggregateConfiguration,
    AggregateFunction,
    AggregateValue,
    ProcessingInterval,
    aggregate_interval,
    processing_intervals,
)
from impactcell.opcua.host_interface import HistoricalValue
from impactcell.opcua.variable_store import moment, nanoseconds

MAX_INTERVALS: Final = 1_000_000
"""Processing intervals in one request, over all its pages."""

AGGREGATE_FUNCTIONS: Final = {
    ua.NodeId(ua.ObjectIds.AggregateFunction_Average): AggregateFunction.AVERAGE,
    ua.NodeId(ua.ObjectIds.AggregateFunction_Minimum): AggregateFunction.MINIMUM,
    ua.NodeId(ua.ObjectIds.AggregateFunction_Maximum): AggregateFunction.MAXIMUM,
    ua.NodeId(ua.ObjectIds.AggregateFunction_Count): AggregateFunction.COUNT,
}


async def read_processed(
    series: HistoricalVariable, details: ua.ReadProcessedDetails, kind: ua.NodeId, resume_ns: int | None
) -> tuple[list[ua.DataValue], int | None]:
    """Aggregate up to a page of intervals, and say where the next page begins.

    Raises
    ------
    StatusCodeError
        BadAggregateNotSupported, BadAggregateInvalidInputs, BadAggregateConfigurationRejected or
        BadInvalidTimestampArgument.
    """
    aggregate = AGGREGATE_FUNCTIONS.get(kind)
    if aggregate is None:
        raise StatusCodeError(ua.StatusCodes.BadAggregateNotSupported)
    configuration = _configuration(details.AggregateConfiguration)
    if min(details.StartTime, details.EndTime) <= BEGINNING or details.StartTime == details.EndTime:
        raise StatusCodeError(ua.StatusCodes.BadInvalidTimestampArgument)
    if not 0.0 <= details.ProcessingInterval < 1e15:
        raise StatusCodeError(ua.StatusCodes.BadAggregateInvalidInputs)
    start, end = nanoseconds(details.StartTime), nanoseconds(details.EndTime)
    step = int(details.ProcessingInterval * 1e6)
    if step and abs(end - start) // step > MAX_INTERVALS:
        raise StatusCodeError(ua.StatusCodes.BadAggregateInvalidInputs)
    intervals: list[ProcessingInterval] = []
    next_ns: int | None = None
    for interval in processing_intervals(start if resume_ns is None else resume_ns, end, step):
        if len(intervals) == VALUES_PER_PAGE:
            next_ns = interval.start_ns
            break
        intervals.append(interval)
    aggregates = await _aggregate(series, aggregate, intervals, configuration)
    value_kind = ua.VariantType.Int32 if aggregate is AggregateFunction.COUNT else ua.VariantType.Double
    return [_data_value(aggregate_value, value_kind) for aggregate_value in aggregates], next_ns


async def _aggregate(
    series: HistoricalVariable,
    aggregate: AggregateFunction,
    intervals: list[ProcessingInterval],
    configuration: AggregateConfiguration,
) -> list[AggregateValue]:
    ends = await series.ends()
    unread: ReadRange | None = ReadRange(
        min(min(interval.start_ns, interval.end_ns) for interval in intervals),
        max(max(interval.start_ns, interval.end_ns) for interval in intervals),
        newest_first=intervals[0].start_ns > intervals[0].end_ns,
    )
    values_ahead: list[HistoricalValue] = []
    results = []
    for interval in intervals:
        # Values come in the order of the intervals: read on until one lies beyond this interval.
        while unread is not None and (not values_ahead or not _beyond(values_ahead[-1], interval)):
            values, unread = await series.page(unread)
            values_ahead.extend(values)
        inside = [value for value in values_ahead if value.time_ns in interval]
        values_ahead = [value for value in values_ahead if _beyond(value, interval)]
        low, high = sorted((interval.start_ns, interval.end_ns))
        within = ends is not None and high > ends[0] and low <= ends[1]
        results.append(aggregate_interval(aggregate, interval, inside, configuration, within=within))
    return results


def _beyond(value: HistoricalValue, interval: ProcessingInterval) -> bool:
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


def _data_value(aggregate_value: AggregateValue, variant_type: ua.VariantType) -> ua.DataValue:
    variant = None if aggregate_value.value is None else ua.Variant(aggregate_value.value, variant_type)
    return ua.DataValue(variant, ua.StatusCode(aggregate_value.status), moment(aggregate_value.time_ns))
