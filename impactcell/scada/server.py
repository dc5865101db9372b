"""The OPC UA server of the service: cells in, nodes out."""

import contextlib
import gc
import logging
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Final, Self
from urllib.parse import urlsplit

from asyncua import ua

from impactcell import __version__
from impactcell.alarms import RULES, EventKind
from impactcell.opcua.address_space.node_references import link
from impactcell.opcua.address_space.variable_store import VariableStore
from impactcell.opcua.asyncua_adapter import AddressSpace, address_space, new_standard_server
from impactcell.opcua.event_notification import EventNotification
from impactcell.opcua.host_interface import Actor, Host, Permission, Product, RefusedError, ServerSettings
from impactcell.opcua.service_host import ServiceHost, aggregate_functions
from impactcell.process.stopping import whole
from impactcell.quantities import HISTORY
from impactcell.records import Alarm, ModuleStatus, Snapshot
from impactcell.scada.access_policy import CellAccess
from impactcell.scada.audit_log import MethodAudit, audited, describe_action
from impactcell.scada.cell_history import CellHistory
from impactcell.scada.cell_nodes import CellSpace, cell_notifiers, load_types, method_declarations
from impactcell.scada.conditions import MAX_SHELVE_S, Condition
from impactcell.scada.german import GERMAN
from impactcell.scada.interface import Actions, CellDescription, ConditionAction, HistorySource
from impactcell.scada.methods import (
    NAMES_EVENT,
    MethodTable,
    bind_cell,
    bind_condition,
    bind_refresh,
    comment_fault,
)
from impactcell.scada.publishing import CellValues
from impactcell.scada.rights import CONDITION_AREAS, Area, allowed
from impactcell.scada.users import Users

_log = logging.getLogger(__name__)

PRODUCT: Final = Product("impactcell", "urn:impactcell", __version__)


@contextlib.contextmanager
def _uncollected() -> Iterator[None]:
    """Keep the garbage collector from looking through an address space that grows: most of a second."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


class Server:
    """An OPC UA server that shows cells.

    Use as an asynchronous context manager; it listens inside. All methods are called from the event loop and
    return at once.

    Parameters
    ----------
    settings : ServerSettings
        Endpoint, security and limits.
    users : Path
        Users file (see `impactcell users add`); read anew when it changes.
    cells : sequence of CellDescription
        What is shown; a cell keeps its NodeIds over restarts, whatever other cells come and go.
    history : HistorySource
        Where HistoryRead finds the past.
    actions : Actions
        Where methods and actions on conditions go.

    Raises
    ------
    AccessError
        On entering: certificate, key or users file are unusable.
    SettingsError
        On entering: the address cannot be listened on; a cell's name cannot be part of a NodeId, or is twice.
    """

    def __init__(
        self,
        settings: ServerSettings,
        users: Path,
        cells: Sequence[CellDescription],
        history: HistorySource,
        actions: Actions,
    ) -> None:
        self._settings = settings
        self._users_file = users
        self._descriptions = tuple(cells)
        self._history = history
        self._actions = actions
        self._cells: dict[str, CellValues] = {}
        self._conditions: dict[tuple[str, str], Condition] = {}
        self._host: ServiceHost | None = None

    @property
    def endpoint(self) -> str:
        """URL the server listens on, with the port that was taken where the settings ask for a free one."""
        url = urlsplit(self._settings.endpoint)
        port = self._host.port if self._host is not None else url.port
        return url._replace(netloc=f"{url.netloc.rpartition(':')[0]}:{port}").geturl()

    async def __aenter__(self) -> Self:
        users = Users(self._users_file)
        if not users.current():
            _log.warning(
                "OPC UA: nobody can log in: %s names no user; add one with `impactcell users add`",
                self._users_file,
            )
        with _uncollected():
            host = await self._built(users)
        try:
            await whole(host.start())
        except BaseException:
            await host.stop()
            raise
        self._host = host
        return self

    async def _built(self, users: Users) -> ServiceHost:
        """Build the address space, and what serves it."""
        model = await new_standard_server(self._settings.application_uri)
        await load_types(model)
        space = address_space(model)
        _offer_aggregates(space)
        uris = await model.get_namespace_array()
        values, access, audit = VariableStore(space), CellAccess(), MethodAudit()
        cells = [CellSpace(model, uris, description) for description in self._descriptions]
        history = self._history_of(cells)
        host = ServiceHost(
            self._settings, Host(PRODUCT, users, access, audit, history, {"de": GERMAN}), space, values
        )
        table = MethodTable(host.method_service, access, audit)
        for cell in cells:
            name = cell.description.name
            self._cells[name] = CellValues(cell, values, space, datetime.now(UTC))
            access.add_notifiers(cell_notifiers(cell))
            bind_cell(table, cell, method_declarations(space, cell.cell_type), self._actions)
            for alarm in RULES:
                condition = Condition(cell, alarm, values, cell_notifiers(cell))
                self._conditions[name, alarm] = condition
                bind_condition(table, cell, condition, self._actions)
        bind_refresh(table, host.subscription_service, self._conditions)
        return host

    def _history_of(self, cells: Sequence[CellSpace]) -> CellHistory:
        variables = {cell.path(path): (cell.description.name, path) for cell in cells for path in HISTORY}
        notifiers = {cell.node: cell.description.name for cell in cells}
        return CellHistory(self._history, variables, notifiers, self._event_of)

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._host is not None:
            await self._host.stop()

    def publish(self, cell: str, snapshot: Snapshot) -> None:
        """Show the values of one cycle; its alarms are shown by `alarm` alone."""
        self._cells[cell].publish(snapshot)

    def positioning(self, cell: str, snapshot: Snapshot, time_ns: int) -> None:
        """Show the positioning task of a snapshot, and nothing else of it."""
        self._cells[cell].positioning(snapshot, time_ns)

    def alarm(self, cell: str, alarm: Alarm) -> None:
        """Show the state of a condition; an event goes out where it has changed.

        Call it in the order of the changes, for every condition after a restart too, with the states that
        were stored.
        """
        event = self._conditions[cell, alarm.name].update(alarm)
        if event is not None and self._host is not None:
            self._host.subscription_service.notify(event)

    def module(self, cell: str, state: ModuleStatus, time_ns: int) -> None:
        """Show the state of the link to the module."""
        self._cells[cell].module(state, time_ns)

    def mark_bad(self, cell: str, time_ns: int) -> None:
        """No communication with the module: all figures of a cycle become Bad and keep their last values."""
        self._cells[cell].lost(time_ns)

    def mark_stale(self, cell: str, time_ns: int) -> None:
        """Nothing new for a while: all figures of a cycle become Uncertain and keep their last values."""
        self._cells[cell].stale(time_ns)

    async def log_in(self, name: str, password: str, address: str) -> Actor:
        """Find out who a password stands for that was typed elsewhere: as slowly as at an OPC UA client.

        Raises
        ------
        RefusedError
            Wrong password, unknown user, or the server does not run.
        """
        if self._host is None:
            raise RefusedError("BadServerHalted")
        return await self._host.log_in(name, password, address)

    async def act_on_condition(self, cell: str, alarm: str, action: ConditionAction, actor: Actor) -> None:
        """Do from elsewhere what the methods of a condition do: same rights, bounds, audit trail and events.

        Raises
        ------
        RefusedError
            The role may not, an argument is out of range, the event has passed, or the state forbids it.
        """
        what = describe_action(cell, alarm, action.event, action.comment, action.shelve_s)
        await audited(actor, what, self._act(cell, alarm, action, actor))

    async def reset_wear(self, cell: str, comment: str, actor: Actor) -> None:
        """Do from elsewhere what the method ResetWear does: same right, bound and audit trail.

        Raises
        ------
        RefusedError
            The role may not, the comment is too long or no text, or the state forbids it.
        """
        await audited(actor, f"{cell}: ResetWear({comment!r})", self._reset_wear(cell, comment, actor))

    async def _reset_wear(self, cell: str, comment: str, actor: Actor) -> None:
        if not allowed(actor.role, Area.RESET_WEAR, Permission.CALL):
            raise RefusedError("BadUserAccessDenied")
        if fault := comment_fault(comment):
            raise RefusedError("BadOutOfRange", fault)
        await self._actions.reset_wear(cell, comment, actor)

    async def _act(self, cell: str, alarm: str, action: ConditionAction, actor: Actor) -> None:
        event, comment = action.event, action.comment
        if not allowed(actor.role, CONDITION_AREAS[event], Permission.CALL):
            raise RefusedError("BadUserAccessDenied")
        if fault := comment_fault(comment):
            raise RefusedError("BadOutOfRange", fault)
        if event is EventKind.COMMENT and not comment:
            raise RefusedError("BadInvalidArgument", "a comment has a text")
        shelve_s = 0.0
        if event is EventKind.SHELVE_ONE_SHOT:
            shelve_s = MAX_SHELVE_S
        elif event is EventKind.SHELVE_TIMED:
            shelve_s = action.shelve_s
            if not 0.0 < shelve_s <= MAX_SHELVE_S:
                raise RefusedError("BadShelvingTimeOutOfRange")
        activation = None
        if event in NAMES_EVENT:
            condition = self._conditions[cell, alarm]
            if not condition.is_current_event(action.event_id):
                raise RefusedError("BadEventIdUnknown", "the alarm has come again since; look at it first")
            activation = condition.alarm.activation
        await self._actions.act_on_condition(
            cell, alarm, event, actor, comment=comment, shelve_s=shelve_s, activation=activation
        )

    def _event_of(self, cell: str, alarm: Alarm) -> EventNotification:
        return self._conditions[cell, alarm.name].past_event(alarm)


def _offer_aggregates(space: AddressSpace) -> None:
    for function in aggregate_functions():
        for folder in (
            ua.ObjectIds.HistoryServerCapabilities_AggregateFunctions,
            ua.ObjectIds.Server_ServerCapabilities_AggregateFunctions,
        ):
            link(space, ua.NodeId(folder), ua.NodeId(ua.ObjectIds.Organizes), function)
