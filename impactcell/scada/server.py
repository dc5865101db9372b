"""The OPC UA server of the service: cells in, nodes out."""

import logging
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from types import TracebackType
from typing import Self

from asyncua import Server as AsyncuaServer

from impactcell.records import Alarm, Snapshot
from impactcell.scada.descriptions import (
    Actions,
    CellDescription,
    HistorySource,
    ModuleState,
    ServerSettings,
)
from impactcell.scada.publishing import CellValues
from impactcell.scada.space import CellSpace, load_types
from impactcell.scada.values import Values

_log = logging.getLogger(__name__)


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
        self._server = AsyncuaServer()
        self._cells: Mapping[str, CellValues] = {}

    @property
    def endpoint(self) -> str:
        """URL the server listens on."""
        return self._settings.endpoint

    async def __aenter__(self) -> Self:
        server = self._server
        server.iserver.disabled_clock = True
        await server.init()
        server.set_endpoint(self._settings.endpoint)
        await load_types(server)
        values = Values(server.iserver.aspace)
        uris = await server.get_namespace_array()
        now = datetime.now(UTC)
        self._cells = {
            description.name: CellValues(
                CellSpace(server, uris, description), values, server.iserver.aspace, now
            )
            for description in self._descriptions
        }
        await server.start()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self._server.stop()

    def publish(self, cell: str, snapshot: Snapshot) -> None:
        """Show all that one cycle has to say, its alarms included."""
        self._cells[cell].publish(snapshot)
        for alarm in snapshot.alarms:
            self.alarm(cell, alarm)

    def alarm(self, cell: str, alarm: Alarm) -> None:
        """Show the state of a condition; an event goes out where it has changed.

        Call it for every condition after a restart too, with the states that were stored.
        """

    def module(self, cell: str, state: ModuleState, time_ns: int) -> None:
        """Show the state of the link to the module."""
        self._cells[cell].module(state, time_ns)

    def mark_bad(self, cell: str, time_ns: int) -> None:
        """No communication with the module: all figures of a cycle become Bad and keep their last values."""
        self._cells[cell].lost(time_ns)

    def mark_stale(self, cell: str, time_ns: int) -> None:
        """Nothing new for a while: all figures of a cycle become Uncertain and keep their last values."""
        self._cells[cell].stale(time_ns)
