"""From the type of a request to the one who answers it, and from what goes wrong to a status code.

Mended: asyncua answers most faults of a request with BadInternalError and some not at all, serves a session's
requests on any channel, and looks at no limit of operations.
"""

import logging
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Any

from asyncua import ua

from impactcell.opcua.asyncua_adapter import MAX_READS_BEFORE_LOGIN, StrictBuffer, field_decoders
from impactcell.opcua.binary_codec import (
    MAX_OPERATIONS,
    DecodingError,
    StatusCodeError,
    decode,
    decode_parameters,
    decode_type,
    encode_response,
    service_fault,
)
from impactcell.opcua.host_interface import Actor
from impactcell.opcua.loop_share import LoopShare
from impactcell.opcua.sessions.large_requests import LargeRequests, Turn
from impactcell.opcua.sessions.session_table import Session, SessionTable
from impactcell.opcua.transport.tcp_connection import TcpConnection

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class RequestContext:
    """What comes with a request."""

    connection: TcpConnection
    header: ua.RequestHeader
    request_id: int
    share: LoopShare
    session_or_none: Session | None = None

    @property
    def session(self) -> Session:
        """Session of the request; only services that need one ask for it."""
        if self.session_or_none is None:
            raise StatusCodeError(ua.StatusCodes.BadSessionIdInvalid)
        return self.session_or_none

    @property
    def actor(self) -> Actor:
        """User behind the request."""
        actor = self.session.actor
        if actor is None:
            raise StatusCodeError(ua.StatusCodes.BadSessionNotActivated)
        return actor


Handler = Callable[[RequestContext, Any], Awaitable[Any]]
"""Answers with a response object, with encoded bytes, or with None where the answer comes later."""


@dataclass(frozen=True, slots=True)
class Service:
    """One service: the structure its parameters come in, and who answers.

    Attributes
    ----------
    waits : bool
        Answering may wait for a disk or another thread, however little there is to do on the loop.
    """

    parameters: type | None
    handler: Handler
    needs_session: bool = True
    waits: bool = False


def request_id(name: str) -> int:
    """Look up the identifier of the binary encoding of a request.

    >>> request_id("Read")
    631
    """
    return int(getattr(ua.ObjectIds, f"{name}Request_Encoding_DefaultBinary"))


class RequestDispatcher:
    """Answers requests of all connections."""

    def __init__(
        self, sessions: SessionTable, services: Mapping[str, Service], lost: Callable[[TcpConnection], None]
    ) -> None:
        self._sessions = sessions
        self._services = {request_id(name): service for name, service in services.items()}
        self._lost = lost
        self.large_requests = LargeRequests()
        for service in services.values():
            if service.parameters is not None:
                field_decoders(service.parameters)  # made now, and not while the first client waits for it

    def disconnected(self, connection: TcpConnection) -> None:
        """Pass on that a connection has gone."""
        self._lost(connection)

    async def handle(self, connection: TcpConnection, request_id: int, body: bytes) -> None:
        """Answer one request; a long one when those before it have been.

        Raises
        ------
        DecodingError
            The message has no header that could be answered.
        """
        async with self.large_requests.turn(len(body)) as turn:
            connection.share.begin()
            await self._handle(connection, request_id, body, turn)

    async def _handle(self, connection: TcpConnection, request_id: int, body: bytes, turn: Turn) -> None:
        buffer = StrictBuffer(body)
        kind = decode_type(buffer)
        header = decode(ua.RequestHeader, buffer)
        handle = header.RequestHandle
        try:
            answer = await self._answer(connection, request_id, kind, header, buffer, turn)
        except StatusCodeError as fault:
            answer = service_fault(handle, fault.code)
        except DecodingError as error:
            _log.warning("request from %s: %s", connection.address, ascii(str(error))[1:-1])
            answer = service_fault(handle, ua.StatusCodes.BadDecodingError)
        except Exception:  # noqa: BLE001 - a fault of ours in one request must not end the others
            _log.exception("request %s from %s", kind, connection.address)
            answer = service_fault(handle, ua.StatusCodes.BadInternalError)
        if answer is None:
            return
        if not isinstance(answer, bytes):
            answer.ResponseHeader.RequestHandle = handle
            try:
                answer = await encode_response(answer, connection.share)
            except StatusCodeError as fault:
                answer = service_fault(handle, fault.code)
        connection.respond(request_id, handle, answer)

    async def _answer(
        self,
        connection: TcpConnection,
        request_id: int,
        kind: ua.NodeId,
        header: ua.RequestHeader,
        body: StrictBuffer,
        turn: Turn,
    ) -> Any:
        service = self._services.get(kind.Identifier) if kind.NamespaceIndex == 0 else None
        if service is None:
            raise StatusCodeError(ua.StatusCodes.BadServiceUnsupported)
        session = None
        if service.needs_session:
            session = self._sessions.resolve(header.AuthenticationToken, connection)
        else:
            body.begin_piece(MAX_READS_BEFORE_LOGIN)
        parameters: Any = body
        if service.parameters is not None:
            parameters = await decode_parameters(service.parameters, body, connection.share)
        context = RequestContext(connection, header, request_id, connection.share, session)
        if not service.waits:
            return await service.handler(context, parameters)
        async with turn.left():
            answer = await service.handler(context, parameters)
        connection.share.begin()
        return answer


def check_operations(operations: list[Any] | None, limit: int = MAX_OPERATIONS) -> list[Any]:
    """Check the operations of one request.

    Raises
    ------
    StatusCodeError
        BadNothingToDo or BadTooManyOperations.
    """
    if not operations:
        raise StatusCodeError(ua.StatusCodes.BadNothingToDo)
    if len(operations) > limit:
        raise StatusCodeError(ua.StatusCodes.BadTooManyOperations)
    return operations


async def apply_to_each(
    share: LoopShare, numbers: list[int], work: Callable[[int], None]
) -> list[ua.StatusCode]:
    """Do something to each of a list of ids; the status codes."""

    def apply(number: int) -> ua.StatusCode:
        try:
            work(number)
        except StatusCodeError as fault:
            return ua.StatusCode(fault.code)
        return ua.StatusCode()

    return await share.each(check_operations(numbers), apply)
