"""The OPC UA server of the service: cells in, nodes out."""

from collections.abc import Sequence
from datetime import UTC, datetime
from types import TracebackType
from typing import Self
from urllib.parse import urlsplit

from asyncua import ua

from impactcell.opcua.asyncua_adapter import address_space, new_standard_server
from impactcell.opcua.event_filter import Event
from impactcell.opcua.history_service import Histories
from impactcell.opcua.node_values import Values
from impactcell.opcua.service_host import Host, aggregate_functions
from impactcell.opcua.type_instances import link
from impactcell.records import Alarm, AlarmName, ModuleStatus, Snapshot
from impactcell.scada.cell_nodes import CellSpace, cell_notifiers, load_types, method_declarations
from impactcell.scada.conditions import Condition
from impactcell.scada.interface import Actions, CellDescription, HistorySource, ServerSettings
from impactcell.scada.methods import bind_cell, bind_condition, bind_refresh
from impactcell.scada.node_table import HISTORY
from impactcell.scada.publishing import CellValues


class Server:
    """An OPC UA server that shows cells.

    Use as an asynchronous context manager; it listens inside. All methods are called from the event loop and
    return at once.

    Parameters
    ----------
    settings : ServerSettings
        Endpoint, security and limits.
    cells : sequence of CellDescription
        What is shown; a cell keeps its NodeIds over restarts, whatever other cells come and go.
    history : HistorySource
        Where HistoryRead finds the past.
    actions : Actions
        Where methods and actions on conditions go.

    Raises
    ------
    AccessError
        On entering: certificate, key, users file or address are unusable.
    SettingsError
        On entering: a name of a cell cannot be part of a NodeId, or is there twice.
    """

    def __init__(
        self,
        settings: ServerSettings,
        cells: Sequence[CellDescription],
        history: HistorySource,
        actions: Actions,
    ) -> None:
        self._settings = settings
        self._descriptions = tuple(cells)
        self._history = history
        self._actions = actions
        self._cells: dict[str, CellValues] = {}
        self._conditions: dict[tuple[str, AlarmName], Condition] = {}
        self._host: Host | None = None

    @property
    def endpoint(self) -> str:
        """URL the server listens on, with the port that was taken where the settings ask for a free one."""
        url = urlsplit(self._settings.endpoint)
        port = self._host.port if self._host is not None else url.port
        return url._replace(netloc=f"{url.netloc.rpartition(':')[0]}:{port}").geturl()

    async def __aenter__(self) -> Self:
        model = await new_standard_server(self._settings.application_uri)
        await load_types(model)
        space = address_space(model)
        values = Values(space)
        host = Host(self._settings, space, values)
        for function in aggregate_functions():
            for folder in (
                ua.ObjectIds.HistoryServerCapabilities_AggregateFunctions,
                ua.ObjectIds.Server_ServerCapabilities_AggregateFunctions,
            ):
                link(space, ua.NodeId(folder), ua.NodeId(ua.ObjectIds.Organizes), function)
        uris = await model.get_namespace_array()
        variables: dict[ua.NodeId, tuple[str, str]] = {}
        notifiers: dict[ua.NodeId, str] = {}
        for description in self._descriptions:
            cell = CellSpace(model, uris, description)
            name = description.name
            self._cells[name] = CellValues(cell, values, space, datetime.now(UTC))
            variables.update({cell.path(path): (name, path) for path in HISTORY})
            notifiers[cell.node] = name
            bind_cell(host.calls, cell, method_declarations(space, cell.kind), self._actions)
            for alarm in AlarmName:
                condition = Condition(cell, alarm, values, cell_notifiers(cell))
                self._conditions[name, alarm] = condition
                bind_condition(host.calls, cell, condition, self._actions, self.alarm)
        bind_refresh(host.calls, host.monitoring, self._conditions)
        histories = Histories(space, self._history, variables, notifiers, self._event_of)
        await host.start(histories.services())
        self._host = host
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._host is not None:
            await self._host.stop()

    def publish(self, cell: str, snapshot: Snapshot) -> None:
        """Show all that one cycle has to say, its alarms included."""
        self._cells[cell].publish(snapshot)
        for alarm in snapshot.alarms:
            self.alarm(cell, alarm)

    def alarm(self, cell: str, alarm: Alarm) -> None:
        """Show the state of a condition; an event goes out where it has changed.

        Call it for every condition after a restart too, with the states that were stored.
        """
        event = self._conditions[cell, alarm.name].update(alarm)
        if event is not None and self._host is not None:
            self._host.monitoring.event(event)

    def module(self, cell: str, state: ModuleStatus, time_ns: int) -> None:
        """Show the state of the link to the module."""
        self._cells[cell].module(state, time_ns)

    def mark_bad(self, cell: str, time_ns: int) -> None:
        """No communication with the module: all figures of a cycle become Bad and keep their last values."""
        self._cells[cell].lost(time_ns)

    def mark_stale(self, cell: str, time_ns: int) -> None:
        """Nothing new for a while: all figures of a cycle become Uncertain and keep their last values."""
        self._cells[cell].stale(time_ns)

    def _event_of(self, cell: str, alarm: Alarm) -> Event:
        return self._conditions[cell, alarm.name].event(alarm)
