"""HistoryRead (Part 11): raw values, aggregates and events, from the source the service gives.

Mended: asyncua keeps history in memory or in a table of its own, mistakes the end of a span, has no
continuation points that survive values with equal times, and no aggregates.
"""

from typing import Any, Final

from asyncua import ua

from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.event_filter import EventFilter
from impactcell.opcua.historical_variable import (
    HistoricalVariable,
    ReadRange,
    data_value,
    read_range,
)
from impactcell.opcua.history_processed import read_processed
from impactcell.opcua.host_interface import AccessPolicy, HistoryProvider, Permission, RefusedError
from impactcell.opcua.method_service import status_of
from impactcell.opcua.request_dispatch import RequestContext, Service, check_operations
from impactcell.opcua.variable_store import with_timestamps

MAX_NODES_PER_READ: Final = 100
"""Nodes in one HistoryRead; shown as MaxNodesPerHistoryReadData."""


class HistoryService:
    """Answers HistoryRead."""

    def __init__(self, space: AddressSpace, access: AccessPolicy, history: HistoryProvider) -> None:
        self._space = space
        self._access = access
        self._history = history

    def services(self) -> dict[str, Service]:
        """Give the services of this set."""
        return {
            "HistoryRead": Service(ua.HistoryReadParameters, self.history_read),
            "HistoryUpdate": Service(None, self.history_update),
        }

    async def history_update(self, _context: RequestContext, _wanted: object) -> None:
        """Refuse: what happened is not changed."""
        raise StatusCodeError(ua.StatusCodes.BadHistoryOperationUnsupported)

    async def history_read(
        self, context: RequestContext, parameters: ua.HistoryReadParameters
    ) -> ua.HistoryReadResponse:
        """Read the past of nodes."""
        nodes = check_operations(parameters.NodesToRead, MAX_NODES_PER_READ)
        details = parameters.HistoryReadDetails
        no_timestamps = parameters.TimestampsToReturn in (
            ua.TimestampsToReturn.Invalid,
            ua.TimestampsToReturn.Neither,
        )
        if no_timestamps and not isinstance(details, ua.ReadEventDetails):
            raise StatusCodeError(ua.StatusCodes.BadTimestampsToReturnInvalid)
        if isinstance(details, ua.ReadProcessedDetails) and len(details.AggregateType or []) != len(nodes):
            raise StatusCodeError(ua.StatusCodes.BadAggregateListMismatch)
        response = ua.HistoryReadResponse()
        response.Results = [
            await self._read_node(context, parameters, index, node) for index, node in enumerate(nodes)
        ]
        return response

    async def _read_node(
        self,
        context: RequestContext,
        parameters: ua.HistoryReadParameters,
        index: int,
        node: ua.HistoryReadValueId,
    ) -> ua.HistoryReadResult:
        result = ua.HistoryReadResult()
        try:
            continuation_points = context.session.history
            state = continuation_points.take(node.ContinuationPoint) if node.ContinuationPoint else None
            if parameters.ReleaseContinuationPoints:
                return result
            details = parameters.HistoryReadDetails
            self._check_node(node, context, events=isinstance(details, ua.ReadEventDetails))
            data, remaining = await self._read_details(node.NodeId, details, index, state)
        except StatusCodeError as fault:
            result.StatusCode = ua.StatusCode(fault.code)
            return result
        except RefusedError as refused:
            result.StatusCode = status_of(refused)
            return result
        if isinstance(data, ua.HistoryData):
            data.DataValues = [
                with_timestamps(value, parameters.TimestampsToReturn) for value in data.DataValues
            ]
            empty = not data.DataValues
        else:
            empty = not data.Events
        result.HistoryData = data
        result.ContinuationPoint = continuation_points.keep(remaining) if remaining is not None else None
        if empty and remaining is None:
            result.StatusCode = ua.StatusCode(ua.StatusCodes.GoodNoData)
        return result

    async def _read_details(self, node: ua.NodeId, details: Any, index: int, state: Any) -> tuple[Any, Any]:
        if isinstance(details, ua.ReadRawModifiedDetails) and not details.IsReadModified:
            return await self._read_raw(node, details, state)
        if isinstance(details, ua.ReadProcessedDetails):
            return await self._read_processed(node, details, details.AggregateType[index], state)
        if isinstance(details, ua.ReadEventDetails):
            return await self._read_events(node, details, state)
        raise StatusCodeError(ua.StatusCodes.BadHistoryOperationUnsupported)

    def _check_node(self, node: ua.HistoryReadValueId, context: RequestContext, *, events: bool) -> None:
        if node.NodeId not in self._space:
            raise StatusCodeError(ua.StatusCodes.BadNodeIdUnknown)
        if not self._access.permits(context.actor.role, Permission.READ_HISTORY, node.NodeId):
            raise StatusCodeError(ua.StatusCodes.BadUserAccessDenied)
        if not (self._history.has_events if events else self._history.has_values)(node.NodeId):
            raise StatusCodeError(ua.StatusCodes.BadHistoryOperationUnsupported)
        if node.IndexRange:
            raise StatusCodeError(ua.StatusCodes.BadIndexRangeInvalid)

    async def _read_raw(
        self, node: ua.NodeId, details: ua.ReadRawModifiedDetails, state: ReadRange | None
    ) -> tuple[ua.HistoryData, ReadRange | None]:
        series = HistoricalVariable(self._history, node)
        current = state or read_range(
            details.StartTime, details.EndTime, details.NumValuesPerNode, bounds=details.ReturnBounds
        )
        values, remaining = await series.read(current)
        data = ua.HistoryData()
        data.DataValues = [data_value(value) for value in values]
        return data, remaining

    async def _read_processed(
        self, node: ua.NodeId, details: ua.ReadProcessedDetails, kind: ua.NodeId, state: int | None
    ) -> tuple[ua.HistoryData, int | None]:
        data = ua.HistoryData()
        data.DataValues, remaining = await read_processed(
            HistoricalVariable(self._history, node), details, kind, state
        )
        return data, remaining

    async def _read_events(
        self, node: ua.NodeId, details: ua.ReadEventDetails, state: ReadRange | None
    ) -> tuple[ua.HistoryEvent, ReadRange | None]:
        event_filter = EventFilter(self._space, details.Filter)
        current = state or read_range(details.StartTime, details.EndTime, details.NumValuesPerNode)
        events: list[ua.HistoryEventFieldList] = []
        remaining: ReadRange | None = current
        while remaining is not None and len(events) < current.limit:
            request = remaining.request(current.limit - len(events))
            page = await self._history.read_events(node, request)
            passed = [event_filter.select(event) for event in page.events if event_filter.passes(event)]
            events += [ua.HistoryEventFieldList(fields.EventFields) for fields in passed]
            remaining = remaining.after(len(passed), page.resume)
        data = ua.HistoryEvent()
        data.Events = events
        return data, remaining
