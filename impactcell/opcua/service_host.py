"""The running server: listener, services and clock put together."""

import asyncio
import contextlib
import logging
import os
from datetime import UTC, datetime
from typing import Final
from urllib.parse import urlsplit

from asyncua import ua

from impactcell.errors import SettingsError
from impactcell.opcua.address_space.variable_store import VariableStore
from impactcell.opcua.asyncua_adapter import AddressSpace, SecurityPolicyFactory, bound_null_arrays
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.certificates.trust_list import TrustList
from impactcell.opcua.history.history_processed import AGGREGATE_FUNCTIONS
from impactcell.opcua.history.history_service import HistoryService
from impactcell.opcua.host_interface import Actor, Host, RefusedError, ServerSettings
from impactcell.opcua.languages import Languages
from impactcell.opcua.server_description import build_info, server_description
from impactcell.opcua.services.attribute_service import AttributeService
from impactcell.opcua.services.discovery_service import POLICIES, DiscoveryService
from impactcell.opcua.services.method_service import MethodService
from impactcell.opcua.services.view_service import ViewService
from impactcell.opcua.session_service import SessionService
from impactcell.opcua.sessions.authentication import Authenticator
from impactcell.opcua.sessions.request_dispatch import RequestDispatcher, Service
from impactcell.opcua.sessions.session_table import SessionTable
from impactcell.opcua.subscriptions.monitored_item_service import MonitoredItemService
from impactcell.opcua.subscriptions.subscription_service import SubscriptionService
from impactcell.opcua.transport.connection_table import ConnectionTable
from impactcell.opcua.transport.secure_channel import ChannelSecurity
from impactcell.opcua.transport.tcp_connection import TcpConnection

_log = logging.getLogger(__name__)

BACKLOG: Final = 1_024
"""Connections the system keeps waiting to be taken."""
CLOCK_PERIOD_S: Final = 1.0
"""Seconds between two looks at the clock, at sessions that have timed out and at changed users."""


class ServiceHost:
    """Everything between the socket and the address space.

    Raises
    ------
    AccessError
        Certificate, key or users file are absent or unusable.
    """

    def __init__(
        self, settings: ServerSettings, host: Host, space: AddressSpace, values: VariableStore
    ) -> None:
        bound_null_arrays()
        self._settings = settings
        self._host = host
        self._space = space
        self._values = values
        self._trust = TrustList(settings.pki, settings.application_uri)
        self._authenticator = Authenticator(host.users, self._trust)
        self._sessions = SessionTable(settings.limits)
        self._discovery = DiscoveryService(settings, host.product, self._trust.own_certificate)
        self._connections = ConnectionTable(settings.limits)
        self._listener: asyncio.Server | None = None
        self._tasks: list[asyncio.Task[None]] = []
        self._started = datetime.now(UTC)
        self._languages = Languages(host.translations)
        self.subscription_service = SubscriptionService(settings.limits, self._languages)
        self.method_service = MethodService(space, host.access, host.audit)
        self._dispatcher: RequestDispatcher | None = None

    @property
    def port(self) -> int:
        """Port the server listens on."""
        return self._discovery.port

    async def start(self) -> None:
        """Listen.

        Raises
        ------
        SettingsError
            The address cannot be listened on.
        """
        settings, host = self._settings, self._host
        if settings.allow_none:
            _log.warning(
                "OPC UA sessions without encryption are allowed (allow_sessions_without_encryption); "
                "use this for trials only"
            )
        session_service = SessionService(
            self._discovery,
            self._sessions,
            self.subscription_service,
            self._authenticator,
            self._trust,
            settings.limits,
            self._languages,
            allow_none=settings.allow_none,
        )
        services: dict[str, Service] = {
            **self._discovery.services(),
            **session_service.services(),
            **AttributeService(self._space, host.access, self._languages).services(),
            **ViewService(self._space, self._languages).services(),
            **self.method_service.services(),
            **self.subscription_service.services(),
            **MonitoredItemService(
                self._space, self._values, host.access, settings.limits, self.subscription_service
            ).services(),
            **HistoryService(self._space, host.access, host.history, self._languages).services(),
        }
        dispatcher = RequestDispatcher(self._sessions, services, self._connection_lost)
        factories = [
            SecurityPolicyFactory(
                POLICIES[policy][0],
                ua.MessageSecurityMode.SignAndEncrypt,
                self._trust.certificate,
                self._trust.private_key,
            )
            for policy in settings.policies
        ]
        channels = ChannelSecurity(factories, self._trust, settings.limits.message_bytes)
        self._describe_server()
        url = urlsplit(settings.endpoint)
        try:
            self._listener = await asyncio.get_running_loop().create_server(
                lambda: TcpConnection(dispatcher, channels, settings.limits, self._connections),
                url.hostname,
                url.port or 0,
                backlog=BACKLOG,
            )
        except (OSError, ValueError) as error:
            number = getattr(error, "errno", None)
            reason = os.strerror(number) if number is not None and number > 0 else str(error)
            raise SettingsError(
                f"OPC UA server: cannot listen on {settings.endpoint} ({reason}); choose another "
                "`opcua.endpoint`, or end what uses it"
            ) from error
        self._discovery.port = self._listener.sockets[0].getsockname()[1]
        loop = asyncio.get_running_loop()
        self._tasks = [
            loop.create_task(self._run_clock(), name="opcua clock"),
            loop.create_task(dispatcher.large_requests.collect_garbage(), name="opcua garbage"),
        ]
        _log.info("OPC UA server listens on %s (port %d)", settings.endpoint, self.port)

    async def log_in(self, name: str, password: str, address: str) -> Actor:
        """Find out who a password stands for that was typed elsewhere than at an OPC UA client.

        Raises
        ------
        RefusedError
            Wrong password or unknown user.
        """
        try:
            return await self._authenticator.identify_by_password(name, password, address)
        except StatusCodeError as error:
            raise RefusedError("BadUserAccessDenied") from error

    async def stop(self) -> None:
        """Close every connection and stop listening."""
        if self._listener is not None:
            self._listener.close()
        for task in self._tasks:
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task
        self.subscription_service.close()
        for connection in self._connections.all():
            assert isinstance(connection, TcpConnection)  # noqa: S101 - nothing else was put in
            connection.abort_with_error(ua.StatusCodes.BadServerHalted, "server stops")
            connection.close()
            await connection.wait_closed()
        if self._listener is not None:
            await self._listener.wait_closed()
        self._authenticator.close()

    def _connection_lost(self, connection: TcpConnection) -> None:
        # A session with subscriptions waits for its client to come back; one without has nothing to
        # come back to.
        for session in self._sessions.detach(connection):
            if not self.subscription_service.subscriptions_of(session):
                self._sessions.remove(session)

    async def _run_clock(self) -> None:
        goes_well = True
        while True:
            try:
                self._tick()
                goes_well = True
            except Exception:  # noqa: BLE001 - sessions end by this clock, and removed users with them
                if goes_well:  # told once, not each second
                    _log.exception("OPC UA clock: a fault of this program; the clock goes on")
                goes_well = False
            await asyncio.sleep(CLOCK_PERIOD_S)

    def _tick(self) -> None:
        now, ids = datetime.now(UTC), ua.ObjectIds
        self._trust.look_at_own(now)
        self._values.set_value(
            ua.NodeId(ids.Server_ServerStatus_CurrentTime), now, ua.VariantType.DateTime, now
        )
        status = ua.ServerStatusDataType(
            StartTime=self._started,
            CurrentTime=now,
            State=ua.ServerState.Running,
            BuildInfo=build_info(self._host.product),
        )
        self._values.set_value(
            ua.NodeId(ids.Server_ServerStatus), status, ua.VariantType.ExtensionObject, now
        )
        for session in self._sessions.expired():
            _log.info("session %r timed out", session.name)
            self.subscription_service.end_session(session, delete=False)
            self._sessions.remove(session)
        self._apply_user_changes()

    def _apply_user_changes(self) -> None:
        """End the sessions of users who are no longer in the users file, and follow changes of role."""
        for session in self._sessions.all():
            actor = session.actor
            if actor is None:
                continue
            user = self._host.users.find(actor.user)
            if user is None:
                _log.warning("user of session %r is gone; session ended", session.name)
                self.subscription_service.end_session(session, delete=True)
                self._sessions.remove(session)
            elif user.role is not actor.role:
                session.actor = Actor(actor.user, user.role, actor.address)

    def _describe_server(self) -> None:
        described = server_description(
            self._settings, self._host.product, self._languages.locale_ids, self._started
        )
        for number, value, kind in described:
            node = ua.NodeId(number)
            if node in self._space:
                self._values.set_value(node, value, kind, self._started)


def aggregate_functions() -> list[ua.NodeId]:
    """List the aggregates that the server shows among its capabilities."""
    return list(AGGREGATE_FUNCTIONS)
