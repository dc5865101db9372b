"""The past of the cells as the OPC UA server asks for it: by NodeId, with status codes and events."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from asyncua import ua

from impactcell.opcua.address_space.variable_store import RASTER_NS
from impactcell.opcua.event_notification import EventNotification
from impactcell.opcua.host_interface import (
    HistoricalEvents,
    HistoricalValue,
    HistoricalValues,
    HistoryRequest,
)
from impactcell.records import Alarm, Quality
from impactcell.scada.interface import HistorySource
from impactcell.scada.publishing import STATUS

EventOf = Callable[[str, Alarm], EventNotification]
"""Makes the event again that an alarm's transition was told with, from the name of its cell."""


def _of_stored_times(request: HistoryRequest) -> HistoryRequest:
    """Ask for what lies in a span by the times that are told, which are stored more finely."""
    start_ns, end_ns = request.start_ns, request.end_ns
    return replace(
        request,
        start_ns=None if start_ns is None else -(-start_ns // RASTER_NS) * RASTER_NS,
        end_ns=None if end_ns is None else end_ns // RASTER_NS * RASTER_NS + RASTER_NS - 1,
    )


class CellHistory:
    """Implements `opcua.HistoryProvider` on a `HistorySource`; a value has the time that it was told with.

    Parameters
    ----------
    source : HistorySource
    variables : mapping
        NodeId of each variable with a history to its cell and its path.
    notifiers : mapping
        NodeId of each cell to its name.
    event_of : callable
    """

    def __init__(
        self,
        source: HistorySource,
        variables: Mapping[ua.NodeId, tuple[str, str]],
        notifiers: Mapping[ua.NodeId, str],
        event_of: EventOf,
    ) -> None:
        self._source = source
        self._variables = variables
        self._notifiers = notifiers
        self._event_of = event_of

    def has_values(self, node: ua.NodeId) -> bool:
        """Whether a variable has a history."""
        return node in self._variables

    def has_events(self, node: ua.NodeId) -> bool:
        """Whether a node is a cell."""
        return node in self._notifiers

    async def read_values(self, node: ua.NodeId, request: HistoryRequest) -> HistoricalValues:
        """Read stored values."""
        page = await self._source.values(*self._variables[node], _of_stored_times(request))
        values = tuple(
            HistoricalValue(
                entry.time_ns // RASTER_NS * RASTER_NS, entry.value, STATUS[Quality(entry.quality)].value
            )
            for entry in page.values
        )
        return HistoricalValues(values, page.resume)

    async def read_events(self, node: ua.NodeId, request: HistoryRequest) -> HistoricalEvents:
        """Read the transitions of a cell's conditions, as the events that told of them."""
        cell = self._notifiers[node]
        page = await self._source.alarms(cell, _of_stored_times(request))
        return HistoricalEvents(tuple(self._event_of(cell, alarm) for alarm in page.alarms), page.resume)
