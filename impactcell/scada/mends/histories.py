"""HistoryRead (Part 11): raw values, aggregates and events, from the source the service gives.

Mended: asyncua keeps history in memory or in a table of its own, mistakes the end of a span, has no
continuation points that survive values with equal times, and no aggregates.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from asyncua import ua
from asyncua.server.address_space import AddressSpace

from impactcell.records import Quality
from impactcell.scada.aggregates import Aggregate, Interval, Treatment, intervals, process
from impactcell.scada.descriptions import HistorySource, HistoryValue
from impactcell.scada.mends.codec import FaultError
from impactcell.scada.mends.dispatch import Context, Service, bounded
from impactcell.scada.mends.eventfilter import Event, EventFilter
from impactcell.scada.rights import Area, Right, allowed
from impactcell.scada.values import STATUS, moment, nanoseconds, with_timestamps

PAGE: Final = 1_000
MOST_NODES: Final = 100
MOST_INTERVALS: Final = 1_000_000
BEGINNING: Final = ua.get_win_epoch()

AGGREGATES: Final = {
    ua.NodeId(ua.ObjectIds.AggregateFunction_Average): Aggregate.AVERAGE,
    ua.NodeId(ua.ObjectIds.AggregateFunction_Minimum): Aggregate.MINIMUM,
    ua.NodeId(ua.ObjectIds.AggregateFunction_Maximum): Aggregate.MAXIMUM,
    ua.NodeId(ua.ObjectIds.AggregateFunction_Count): Aggregate.COUNT,
}


@dataclass(frozen=True, slots=True)
class Span:
    """A question about a span of time: `left` values at most are still wanted, None for all."""

    start_ns: int | None
    end_ns: int | None
    newest_first: bool
    left: int | None
    resume: bytes | None = None


EventOf = Callable[[str, Any], Event]
"""Makes the event again that an alarm's transition was told with."""


class Histories:
    """Answers HistoryRead."""

    def __init__(
        self,
        space: AddressSpace,
        source: HistorySource,
        variables: Mapping[ua.NodeId, tuple[str, str]],
        notifiers: Mapping[ua.NodeId, str],
        event_of: EventOf,
    ) -> None:
        self._space = space
        self._source = source
        self._variables = variables
        self._notifiers = notifiers
        self._event_of = event_of

    def services(self) -> dict[str, Service]:
        """Give the services of this set."""
        return {
            "HistoryRead": Service(ua.HistoryReadParameters, self.read),
            "HistoryUpdate": Service(None, self.update),
        }

    async def update(self, _context: Context, _wanted: object) -> None:
        """Refuse: what happened is not changed."""
        raise FaultError(ua.StatusCodes.BadHistoryOperationUnsupported)

    async def read(self, context: Context, wanted: ua.HistoryReadParameters) -> ua.HistoryReadResponse:
        """Read the past of nodes."""
        nodes = bounded(wanted.NodesToRead, MOST_NODES)
        details = wanted.HistoryReadDetails
        no_timestamps = wanted.TimestampsToReturn in (
            ua.TimestampsToReturn.Invalid,
            ua.TimestampsToReturn.Neither,
        )
        if no_timestamps and not isinstance(details, ua.ReadEventDetails):
            raise FaultError(ua.StatusCodes.BadTimestampsToReturnInvalid)
        if isinstance(details, ua.ReadProcessedDetails) and len(details.AggregateType or []) != len(nodes):
            raise FaultError(ua.StatusCodes.BadAggregateListMismatch)
        response = ua.HistoryReadResponse()
        response.Results = [
            await self._read(context, wanted, index, node) for index, node in enumerate(nodes)
        ]
        return response

    async def _read(
        self, context: Context, wanted: ua.HistoryReadParameters, index: int, node: ua.HistoryReadValueId
    ) -> ua.HistoryReadResult:
        result = ua.HistoryReadResult()
        try:
            kept = context.session.history
            state = kept.take(node.ContinuationPoint) if node.ContinuationPoint else None
            if wanted.ReleaseContinuationPoints:
                return result
            details = wanted.HistoryReadDetails
            self._check(node, context, events=isinstance(details, ua.ReadEventDetails))
            data, rest = await self._ask(node.NodeId, details, index, state)
        except FaultError as fault:
            result.StatusCode = ua.StatusCode(fault.code)
            return result
        if isinstance(data, ua.HistoryData):
            data.DataValues = [with_timestamps(value, wanted.TimestampsToReturn) for value in data.DataValues]
            empty = not data.DataValues
        else:
            empty = not data.Events
        result.HistoryData = data
        result.ContinuationPoint = kept.keep(rest) if rest is not None else None
        if empty:
            result.StatusCode = ua.StatusCode(ua.StatusCodes.GoodNoData)
        return result

    async def _ask(self, node: ua.NodeId, details: Any, index: int, state: Any) -> tuple[Any, Any]:
        if isinstance(details, ua.ReadRawModifiedDetails) and not details.IsReadModified:
            return await self._raw(node, details, state)
        if isinstance(details, ua.ReadProcessedDetails):
            return await self._processed(node, details, details.AggregateType[index], state)
        if isinstance(details, ua.ReadEventDetails):
            return await self._events(node, details, state)
        raise FaultError(ua.StatusCodes.BadHistoryOperationUnsupported)

    def _check(self, node: ua.HistoryReadValueId, context: Context, *, events: bool) -> None:
        if node.NodeId not in self._space:
            raise FaultError(ua.StatusCodes.BadNodeIdUnknown)
        area = Area.EVENTS if events else Area.VALUES
        if not allowed(context.actor.role, area, Right.HISTORY):
            raise FaultError(ua.StatusCodes.BadUserAccessDenied)
        if node.NodeId not in (self._notifiers if events else self._variables):
            raise FaultError(ua.StatusCodes.BadHistoryOperationUnsupported)
        if node.IndexRange:
            raise FaultError(ua.StatusCodes.BadIndexRangeInvalid)

    async def _raw(
        self, node: ua.NodeId, details: ua.ReadRawModifiedDetails, state: Span | None
    ) -> tuple[ua.HistoryData, Span | None]:
        if details.ReturnBounds:
            raise FaultError(ua.StatusCodes.BadHistoryOperationUnsupported)
        span = state or _span(details.StartTime, details.EndTime, details.NumValuesPerNode)
        cell, variable = self._variables[node]
        values, rest = await self._page(cell, variable, span)
        data = ua.HistoryData()
        data.DataValues = [_data_value(value) for value in values]
        return data, rest

    async def _page(self, cell: str, variable: str, span: Span) -> tuple[Sequence[HistoryValue], Span | None]:
        most = PAGE if span.left is None else min(PAGE, span.left)
        page = await self._source.values(
            cell,
            variable,
            span.start_ns,
            span.end_ns,
            most,
            newest_first=span.newest_first,
            resume=span.resume,
        )
        return page.values, _rest(span, len(page.values), page.resume)

    async def _processed(
        self, node: ua.NodeId, details: ua.ReadProcessedDetails, kind: ua.NodeId, state: int | None
    ) -> tuple[ua.HistoryData, int | None]:
        aggregate = AGGREGATES.get(kind)
        if aggregate is None:
            raise FaultError(ua.StatusCodes.BadAggregateNotSupported)
        treatment = _treatment(details.AggregateConfiguration)
        if (
            details.StartTime <= BEGINNING
            or details.EndTime <= BEGINNING
            or details.StartTime == details.EndTime
        ):
            raise FaultError(ua.StatusCodes.BadInvalidTimestampArgument)
        if not 0.0 <= details.ProcessingInterval < 1e15:
            raise FaultError(ua.StatusCodes.BadAggregateInvalidInputs)
        start, end = nanoseconds(details.StartTime), nanoseconds(details.EndTime)
        step = int(details.ProcessingInterval * 1e6)
        if step and abs(end - start) // step > MOST_INTERVALS:
            raise FaultError(ua.StatusCodes.BadAggregateInvalidInputs)
        at = state if state is not None else start
        wanted: list[Interval] = []
        rest: int | None = None
        for interval in intervals(at, end, step):
            if len(wanted) == PAGE:
                rest = interval.start_ns
                break
            wanted.append(interval)
        data = ua.HistoryData()
        data.DataValues = await self._aggregate(self._variables[node], aggregate, wanted, treatment)
        return data, rest

    async def _aggregate(
        self, variable: tuple[str, str], aggregate: Aggregate, wanted: list[Interval], treatment: Treatment
    ) -> list[ua.DataValue]:
        first, last = await self._ends(*variable)
        span = Span(
            min(min(i.start_ns, i.end_ns) for i in wanted),
            max(max(i.start_ns, i.end_ns) for i in wanted),
            newest_first=wanted[0].start_ns > wanted[0].end_ns,
            left=None,
        )
        held: list[HistoryValue] = []
        rest: Span | None = span
        results = []
        for interval in wanted:
            # Values come in the order of the intervals: read on until one lies beyond this interval.
            while rest is not None and (
                not held or held[-1].time_ns in interval or _before(held[-1], interval)
            ):
                values, rest = await self._page(*variable, rest)
                held.extend(values)
            inside = [value for value in held if value.time_ns in interval]
            held = [value for value in held if not (value.time_ns in interval or _before(value, interval))]
            low, high = sorted((interval.start_ns, interval.end_ns))
            within = first is not None and last is not None and high > first and low <= last
            results.append(process(aggregate, interval, inside, treatment, within=within))
        kind = ua.VariantType.Int32 if aggregate is Aggregate.COUNT else ua.VariantType.Double
        return [
            ua.DataValue(
                None if r.value is None else ua.Variant(r.value, kind),
                ua.StatusCode(r.status),
                moment(r.time_ns),
            )
            for r in results
        ]

    async def _ends(self, cell: str, variable: str) -> tuple[int | None, int | None]:
        first = await self._source.values(cell, variable, None, None, 1)
        last = await self._source.values(cell, variable, None, None, 1, newest_first=True)
        if not first.values or not last.values:
            return None, None
        return first.values[0].time_ns, last.values[0].time_ns

    async def _events(
        self, node: ua.NodeId, details: ua.ReadEventDetails, state: Span | None
    ) -> tuple[ua.HistoryEvent, Span | None]:
        wanted = EventFilter(self._space, details.Filter)
        span = state or _span(details.StartTime, details.EndTime, details.NumValuesPerNode)
        cell = self._notifiers[node]
        most = PAGE if span.left is None else min(PAGE, span.left)
        page = await self._source.alarms(
            cell, span.start_ns, span.end_ns, most, newest_first=span.newest_first, resume=span.resume
        )
        data = ua.HistoryEvent()
        events = [self._event_of(cell, alarm) for alarm in page.alarms]
        passed = [event for event in events if wanted.passes(event)]
        data.Events = [ua.HistoryEventFieldList(wanted.select(event).EventFields) for event in passed]
        return data, _rest(span, len(passed), page.resume)


def _before(value: HistoryValue, interval: Interval) -> bool:
    forward = interval.start_ns <= interval.end_ns
    return value.time_ns < interval.start_ns if forward else value.time_ns > interval.start_ns


def _rest(span: Span, given: int, resume: bytes | None) -> Span | None:
    left = None if span.left is None else span.left - given
    if resume is None or left == 0:
        return None
    return replace(span, left=left, resume=resume)


def _span(start: Any, end: Any, most: int) -> Span:
    """Read the bounds of a question (Part 11, 6.4.3.2): two of start, end and number are needed.

    The start belongs to the span and the end does not, in whichever direction time runs.
    """
    begin = nanoseconds(start) if start is not None and start > BEGINNING else None
    finish = nanoseconds(end) if end is not None and end > BEGINNING else None
    left = most or None
    if (begin is None) + (finish is None) + (left is None) > 1:
        raise FaultError(ua.StatusCodes.BadInvalidTimestampArgument)
    if begin is None:
        # Backwards from the end, which is where the question begins and so belongs to it.
        return Span(None, finish, newest_first=True, left=left)
    if finish is None:
        return Span(begin, None, newest_first=False, left=left)
    if begin > finish:
        return Span(finish + 1, begin, newest_first=True, left=left)
    return Span(begin, max(finish - 1, begin), newest_first=False, left=left)


def _treatment(given: ua.AggregateConfiguration) -> Treatment:
    if given.UseServerCapabilitiesDefaults:
        return Treatment()
    bad, good = given.PercentDataBad, given.PercentDataGood
    if bad > 100 or good > 100 or bad + good < 100:
        raise FaultError(ua.StatusCodes.BadAggregateConfigurationRejected)
    return Treatment(given.TreatUncertainAsBad, bad, good)


def _data_value(value: HistoryValue) -> ua.DataValue:
    variant = ua.Variant(value.value, ua.VariantType.Double)
    return ua.DataValue(variant, STATUS[Quality(value.quality)], moment(value.time_ns), moment(value.time_ns))
