"""HistoryRead (Part 11): raw values, aggregates and events, from the source the service gives.

Mended: asyncua keeps history in memory or in a table of its own, mistakes the end of a span, has no
continuation points that survive values with equal times, and no aggregates.
"""

from dataclasses import dataclass
from typing import Any, Final

from asyncua import ua

from impactcell.opcua.asyncua_adapter import AddressSpace
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.filters.event_filter import EventFilter
from impactcell.opcua.history.historical_variable import HistoricalVariable, ReadRange, parse_read_range
from impactcell.opcua.history.history_encoding import DataValueEncoder, history_data
from impactcell.opcua.history.history_processed import ProcessedReading
from impactcell.opcua.history.read_budget import ReadBudget
from impactcell.opcua.host_interface import AccessPolicy, HistoryProvider, Permission, RefusedError
from impactcell.opcua.languages import Languages
from impactcell.opcua.services.method_service import status_of
from impactcell.opcua.sessions.request_dispatch import RequestContext, Service, check_operations

MAX_NODES_PER_READ: Final = 100
"""Nodes in one HistoryRead; shown as MaxNodesPerHistoryReadData."""
EVENTS_AT_ONCE: Final = 10
"""Events that are made again and filtered between two turns of others: some 3 ms."""


@dataclass(frozen=True, slots=True)
class _UnfinishedRead:
    """What a continuation point stands for: it goes on with the same node and the same kind of question.

    When it expires, `continuation_points` says.
    """

    node: ua.NodeId
    details: type
    state: ReadRange | ProcessedReading

    def read_on(self, node: ua.HistoryReadValueId, details: object) -> ReadRange | ProcessedReading:
        if (self.node, self.details) != (node.NodeId, type(details)):
            raise StatusCodeError(ua.StatusCodes.BadContinuationPointInvalid)
        return self.state


class HistoryService:
    """Answers HistoryRead."""

    def __init__(
        self, space: AddressSpace, access: AccessPolicy, history: HistoryProvider, languages: Languages
    ) -> None:
        self._languages = languages
        self._space = space
        self._access = access
        self._history = history

    def services(self) -> dict[str, Service]:
        """Give the services of this set."""
        return {
            "HistoryRead": Service(ua.HistoryReadParameters, self.history_read, waits=True),
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
        budget = ReadBudget(context.share.turns, context.header.TimeoutHint)
        response = ua.HistoryReadResponse()
        response.Results = [
            await self._read_node(context, parameters, index, budget) for index in range(len(nodes))
        ]
        return response

    async def _read_node(
        self,
        context: RequestContext,
        parameters: ua.HistoryReadParameters,
        index: int,
        budget: ReadBudget,
    ) -> ua.HistoryReadResult:
        result, node = ua.HistoryReadResult(), parameters.NodesToRead[index]
        points, details = context.session.history_points, parameters.HistoryReadDetails
        try:
            kept = points.take(node.ContinuationPoint) if node.ContinuationPoint else None
            if parameters.ReleaseContinuationPoints:
                return result
            self._check_node(node, context, events=isinstance(details, ua.ReadEventDetails))
            state = self._begin(node.NodeId, details, index) if kept is None else kept.read_on(node, details)
            if not budget.is_spent:
                result.HistoryData, is_empty, state = await self._go_on(
                    node.NodeId, parameters, state, budget
                )
                if isinstance(result.HistoryData, ua.HistoryEvent):
                    self._translate(result.HistoryData, context.session.language)
                if is_empty and state is None:
                    result.StatusCode = ua.StatusCode(ua.StatusCodes.GoodNoData)
        except StatusCodeError as fault:
            result.StatusCode = ua.StatusCode(fault.code)
        except RefusedError as refused:
            result.StatusCode = status_of(refused)
        else:
            if state is not None:
                result.ContinuationPoint = points.keep(_UnfinishedRead(node.NodeId, type(details), state))
        return result

    def _translate(self, events: ua.HistoryEvent, language: str | None) -> None:
        for event in events.Events:
            event.EventFields = [self._languages.variant(field, language) for field in event.EventFields]

    def _check_node(self, node: ua.HistoryReadValueId, context: RequestContext, *, events: bool) -> None:
        if context.session.closed:  # while a node before was read
            raise StatusCodeError(ua.StatusCodes.BadSessionClosed)
        if node.NodeId not in self._space:
            raise StatusCodeError(ua.StatusCodes.BadNodeIdUnknown)
        if not self._access.permits(context.actor.role, Permission.READ_HISTORY, node.NodeId):
            raise StatusCodeError(ua.StatusCodes.BadUserAccessDenied)
        if not (self._history.has_events if events else self._history.has_values)(node.NodeId):
            raise StatusCodeError(ua.StatusCodes.BadHistoryOperationUnsupported)
        if node.IndexRange:
            raise StatusCodeError(ua.StatusCodes.BadIndexRangeInvalid)

    def _begin(self, node: ua.NodeId, details: Any, index: int) -> ReadRange | ProcessedReading:
        """Check what is asked of one node; nothing is read yet."""
        if isinstance(details, ua.ReadRawModifiedDetails) and not details.IsReadModified:
            return parse_read_range(
                details.StartTime, details.EndTime, details.NumValuesPerNode, bounds=details.ReturnBounds
            )
        if isinstance(details, ua.ReadProcessedDetails):
            series = HistoricalVariable(self._history, node)
            return ProcessedReading(series, details, details.AggregateType[index])
        if isinstance(details, ua.ReadEventDetails):
            return parse_read_range(details.StartTime, details.EndTime, details.NumValuesPerNode)
        raise StatusCodeError(ua.StatusCodes.BadHistoryOperationUnsupported)

    async def _go_on(
        self, node: ua.NodeId, parameters: ua.HistoryReadParameters, state: Any, budget: ReadBudget
    ) -> tuple[Any, bool, ReadRange | ProcessedReading | None]:
        """Read on; what goes into the answer, whether that is nothing, and what is left."""
        details, timestamps = parameters.HistoryReadDetails, parameters.TimestampsToReturn
        if isinstance(state, ProcessedReading):
            aggregates = await state.read(budget)
            encoder = DataValueEncoder(timestamps, is_count=state.is_count)
            data = history_data(map(encoder.encode, aggregates))
            return data, not aggregates, None if state.is_finished else state
        if isinstance(details, ua.ReadEventDetails):
            return await self._read_events(node, details, state, budget)
        values, left = await HistoricalVariable(self._history, node).read(state, budget)
        return history_data(map(DataValueEncoder(timestamps).encode, values)), not values, left

    async def _read_events(
        self, node: ua.NodeId, details: ua.ReadEventDetails, current: ReadRange, budget: ReadBudget
    ) -> tuple[ua.HistoryEvent, bool, ReadRange | None]:
        event_filter = EventFilter(self._space, details.Filter)
        limit, events = budget.room(current.limit), list[ua.HistoryEventFieldList]()
        remaining: ReadRange | None = current
        while remaining is not None and len(events) < limit and not budget.is_spent:
            request = remaining.request(min(limit - len(events), EVENTS_AT_ONCE))
            page = await self._history.read_events(node, request)
            passed = [event_filter.select(event) for event in page.events if event_filter.passes(event)]
            events += [ua.HistoryEventFieldList(fields.EventFields) for fields in passed]
            remaining = remaining.after(len(passed), page.resume)
            await budget.spend(len(passed))
        return ua.HistoryEvent(events), not events, remaining
