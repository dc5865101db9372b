"""ReadProcessedDetails: aggregates of a stored series, interval by interval (Part 11, 6.5.4)."""

from dataclasses import replace
from typing import Final

from asyncua import ua

from impactcell.opcua.binary_codec import FaultError
from impactcell.opcua.history_aggregates import Aggregate, Interval, Processed, Treatment, intervals, process
from impactcell.opcua.history_paging import BEGINNING, PAGE, Series, Span
from impactcell.opcua.host_interface import HistoricalValue
from impactcell.opcua.node_values import moment, nanoseconds

MOST_INTERVALS: Final = 1_000_000

AGGREGATES: Final = {
    ua.NodeId(ua.ObjectIds.AggregateFunction_Average): Aggregate.AVERAGE,
    ua.NodeId(ua.ObjectIds.AggregateFunction_Minimum): Aggregate.MINIMUM,
    ua.NodeId(ua.ObjectIds.AggregateFunction_Maximum): Aggregate.MAXIMUM,
    ua.NodeId(ua.ObjectIds.AggregateFunction_Count): Aggregate.COUNT,
}


async def read_processed(
    series: Series, details: ua.ReadProcessedDetails, kind: ua.NodeId, resume_ns: int | None
) -> tuple[list[ua.DataValue], int | None]:
    """Aggregate up to a page of intervals, and say where the next page begins.

    Raises
    ------
    FaultError
        BadAggregateNotSupported, BadAggregateInvalidInputs, BadAggregateConfigurationRejected or
        BadInvalidTimestampArgument.
    """
    aggregate = AGGREGATES.get(kind)
    if aggregate is None:
        raise FaultError(ua.StatusCodes.BadAggregateNotSupported)
    treatment = _treatment(details.AggregateConfiguration)
    if min(details.StartTime, details.EndTime) <= BEGINNING or details.StartTime == details.EndTime:
        raise FaultError(ua.StatusCodes.BadInvalidTimestampArgument)
    if not 0.0 <= details.ProcessingInterval < 1e15:
        raise FaultError(ua.StatusCodes.BadAggregateInvalidInputs)
    start, end = nanoseconds(details.StartTime), nanoseconds(details.EndTime)
    step = int(details.ProcessingInterval * 1e6)
    if step and abs(end - start) // step > MOST_INTERVALS:
        raise FaultError(ua.StatusCodes.BadAggregateInvalidInputs)
    wanted: list[Interval] = []
    next_ns: int | None = None
    for interval in intervals(start if resume_ns is None else resume_ns, end, step):
        if len(wanted) == PAGE:
            next_ns = interval.start_ns
            break
        wanted.append(interval)
    found = await _aggregate(series, aggregate, wanted, treatment)
    value_kind = ua.VariantType.Int32 if aggregate is Aggregate.COUNT else ua.VariantType.Double
    return [_data_value(each, value_kind) for each in found], next_ns


async def _aggregate(
    series: Series, aggregate: Aggregate, wanted: list[Interval], treatment: Treatment
) -> list[Processed]:
    ends = await series.ends()
    left: Span | None = Span(
        min(min(each.start_ns, each.end_ns) for each in wanted),
        max(max(each.start_ns, each.end_ns) for each in wanted),
        newest_first=wanted[0].start_ns > wanted[0].end_ns,
        left=None,
    )
    held: list[HistoricalValue] = []
    results = []
    for interval in wanted:
        # Values come in the order of the intervals: read on until one lies beyond this interval.
        while left is not None and (not held or not _beyond(held[-1], interval)):
            values, left = await series.page(replace(left, left=None))
            held.extend(values)
        inside = [value for value in held if value.time_ns in interval]
        held = [value for value in held if _beyond(value, interval)]
        low, high = sorted((interval.start_ns, interval.end_ns))
        within = ends is not None and high > ends[0] and low <= ends[1]
        results.append(process(aggregate, interval, inside, treatment, within=within))
    return results


def _beyond(value: HistoricalValue, interval: Interval) -> bool:
    """Whether a value comes after an interval, in the direction of the intervals."""
    if interval.start_ns <= interval.end_ns:
        return value.time_ns >= interval.end_ns
    return value.time_ns <= interval.end_ns


def _treatment(given: ua.AggregateConfiguration) -> Treatment:
    if given.UseServerCapabilitiesDefaults:
        return Treatment()
    bad, good = given.PercentDataBad, given.PercentDataGood
    if bad > 100 or good > 100 or bad + good < 100:
        raise FaultError(ua.StatusCodes.BadAggregateConfigurationRejected)
    return Treatment(given.TreatUncertainAsBad, bad, good)


def _data_value(found: Processed, kind: ua.VariantType) -> ua.DataValue:
    variant = None if found.value is None else ua.Variant(found.value, kind)
    return ua.DataValue(variant, ua.StatusCode(found.status), moment(found.time_ns))
