"""HistoryRead (Part 11): raw values, aggregates and events, from the source the service gives.

Mended: asyncua keeps history in memory or in a table of its own, mistakes the end of a span, has no
continuation points that survive values with equal times, and no aggregates.
"""

from typing import Any, Final

from asyncua import ua

from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.binary_codec import FaultError
from impactcell.opcua.event_filter import EventFilter
from impactcell.opcua.history_paging import Series, Span, data_value, rest, span
from impactcell.opcua.history_processed import read_processed
from impactcell.opcua.host_interface import AccessPolicy, HistoryProvider, Permission, RefusedError
from impactcell.opcua.node_values import with_timestamps
from impactcell.opcua.request_dispatch import Context, Service, bounded

MOST_NODES: Final = 100


class Histories:
    """Answers HistoryRead."""

    def __init__(self, space: AddressSpace, access: AccessPolicy, history: HistoryProvider) -> None:
        self._space = space
        self._access = access
        self._history = history

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
            data, left = await self._ask(node.NodeId, details, index, state)
        except FaultError as fault:
            result.StatusCode = ua.StatusCode(fault.code)
            return result
        except RefusedError as refused:
            result.StatusCode = ua.StatusCode(getattr(ua.StatusCodes, refused.code))
            return result
        if isinstance(data, ua.HistoryData):
            data.DataValues = [with_timestamps(value, wanted.TimestampsToReturn) for value in data.DataValues]
            empty = not data.DataValues
        else:
            empty = not data.Events
        result.HistoryData = data
        result.ContinuationPoint = kept.keep(left) if left is not None else None
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
        if not self._access.permits(context.actor.role, Permission.READ_HISTORY, node.NodeId):
            raise FaultError(ua.StatusCodes.BadUserAccessDenied)
        if not (self._history.has_events if events else self._history.has_values)(node.NodeId):
            raise FaultError(ua.StatusCodes.BadHistoryOperationUnsupported)
        if node.IndexRange:
            raise FaultError(ua.StatusCodes.BadIndexRangeInvalid)

    async def _raw(
        self, node: ua.NodeId, details: ua.ReadRawModifiedDetails, state: Span | None
    ) -> tuple[ua.HistoryData, Span | None]:
        series = Series(self._history, node)
        asked = state or span(
            details.StartTime, details.EndTime, details.NumValuesPerNode, bounds=details.ReturnBounds
        )
        values, left = await series.page(asked)
        data = ua.HistoryData()
        data.DataValues = [data_value(value) for value in values]
        if asked.bounds is not None:
            start, end = asked.bounds
            if state is None and (not values or values[0].time_ns != start):
                data.DataValues.insert(0, await series.bound(start, later=asked.newest_first))
            if left is None:
                data.DataValues.append(await series.bound(end, later=not asked.newest_first))
        return data, left

    async def _processed(
        self, node: ua.NodeId, details: ua.ReadProcessedDetails, kind: ua.NodeId, state: int | None
    ) -> tuple[ua.HistoryData, int | None]:
        data = ua.HistoryData()
        data.DataValues, left = await read_processed(Series(self._history, node), details, kind, state)
        return data, left

    async def _events(
        self, node: ua.NodeId, details: ua.ReadEventDetails, state: Span | None
    ) -> tuple[ua.HistoryEvent, Span | None]:
        wanted = EventFilter(self._space, details.Filter)
        asked = state or span(details.StartTime, details.EndTime, details.NumValuesPerNode)
        page = await self._history.read_events(node, asked.request())
        data = ua.HistoryEvent()
        passed = [event for event in page.events if wanted.passes(event)]
        data.Events = [ua.HistoryEventFieldList(wanted.select(event).EventFields) for event in passed]
        return data, rest(asked, len(passed), page.resume)
