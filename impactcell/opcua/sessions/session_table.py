"""Sessions: who is behind a request, over which channel, for how long.

Mended: asyncua numbers its authentication tokens (the next one can be guessed), never looks at the token a
request carries, lets any trusted client take over any session, keeps one session per connection and forgets
the rest, and limits sessions only by the thousand.
"""

import os
import time
from collections import deque
from dataclasses import dataclass, field
from typing import Final

from asyncua import ua

from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.continuation_points import MAX_BROWSE_POINTS, MAX_HISTORY_POINTS, ContinuationPoints
from impactcell.opcua.host_interface import Actor, ServerLimits
from impactcell.opcua.transport.tcp_connection import TcpConnection

MIN_TIMEOUT_S: Final = 10.0
"""Shortest timeout of a session, seconds."""
MAX_SESSION_NAME: Final = 128
"""Characters kept of the name of a session: it is for the log alone."""


@dataclass(frozen=True, slots=True)
class PublishRequest:
    """A Publish request that waits for something to say."""

    request_id: int
    handle: int
    results: bytes
    expires: float


@dataclass(eq=False, slots=True)
class Session:
    """One session; it outlives its connection until its timeout."""

    session_id: ua.NodeId
    token: ua.NodeId
    name: str
    connection: TcpConnection | None
    policy_uri: str
    certificate: bytes | None
    timeout_s: float
    nonce: bytes = b""
    actor: Actor | None = None
    language: str | None = None
    last_seen: float = field(default_factory=time.monotonic)
    publish_requests: deque[PublishRequest] = field(default_factory=deque)
    browse_points: ContinuationPoints = field(default_factory=lambda: ContinuationPoints(MAX_BROWSE_POINTS))
    history_points: ContinuationPoints = field(default_factory=lambda: ContinuationPoints(MAX_HISTORY_POINTS))
    closed: bool = False

    @property
    def is_activated(self) -> bool:
        """Whether a user has logged in."""
        return self.actor is not None

    def attach(self, connection: TcpConnection | None) -> None:
        """Go on over a connection, or over none for now.

        Publish requests that wait are answered by the numbers of the channel they came on: they end with it.
        """
        if connection is not self.connection:
            self.connection = connection
            self.publish_requests.clear()

    def renew_nonce(self) -> bytes:
        """Make the nonce the client has to sign next."""
        self.nonce = os.urandom(32)
        return self.nonce


class SessionTable:
    """All sessions of the server."""

    def __init__(self, limits: ServerLimits) -> None:
        self._limits = limits
        self._sessions: dict[ua.NodeId, Session] = {}

    def __len__(self) -> int:
        return len(self._sessions)

    @staticmethod
    def clock() -> float:
        """Time that `last_seen` counts in, seconds."""
        return time.monotonic()

    def all(self) -> list[Session]:
        """Every session that is not closed."""
        return list(self._sessions.values())

    def create(
        self, connection: TcpConnection, name: str, timeout_ms: float, certificate: bytes | None
    ) -> Session:
        """Make a session.

        Raises
        ------
        StatusCodeError
            BadTooManySessions.
        """
        if len(self._sessions) >= self._limits.sessions:
            self._make_room()
        longest = self._limits.session_timeout_s
        requested_s = timeout_ms / 1e3 if timeout_ms > 0 else longest
        session = Session(
            session_id=ua.NodeId(os.urandom(16), 1, ua.NodeIdType.ByteString),
            token=ua.NodeId(os.urandom(32), 0, ua.NodeIdType.ByteString),
            name=(name or "")[:MAX_SESSION_NAME],
            connection=connection,
            policy_uri=connection.channel.policy_uri,
            certificate=certificate,
            timeout_s=min(max(requested_s, MIN_TIMEOUT_S), longest),
        )
        session.renew_nonce()
        self._sessions[session.token] = session
        return session

    def _make_room(self) -> None:
        # Part 4, 5.6.2: a session that was never activated gives way, so that nobody is locked out by
        # clients that only create sessions.
        idle = [session for session in self._sessions.values() if not session.is_activated]
        if not idle:
            raise StatusCodeError(ua.StatusCodes.BadTooManySessions)
        oldest = min(idle, key=lambda session: session.last_seen)
        if time.monotonic() - oldest.last_seen < self._limits.undisturbed_s:
            raise StatusCodeError(ua.StatusCodes.BadTooManySessions)
        self.remove(oldest)

    def admit(self, session: Session, user: str) -> Session | None:
        """See that a user may have this session too; the one of his that has to end for it, if any.

        Raises
        ------
        StatusCodeError
            BadTooManySessions.
        """
        of_user = [s for s in self._sessions.values() if s.actor is not None and s.actor.user == user]
        if session not in of_user and len(of_user) >= self._limits.sessions_per_user:
            # One whose client is gone, and may never come back, gives way.
            gone = [s for s in of_user if s.connection is None]
            if not gone:
                raise StatusCodeError(ua.StatusCodes.BadTooManySessions)
            return min(gone, key=lambda s: s.last_seen)
        return None

    def find(self, token: ua.NodeId) -> Session:
        """Find a session by its authentication token.

        Raises
        ------
        StatusCodeError
            BadSessionIdInvalid.
        """
        session = self._sessions.get(token)
        if session is None:
            raise StatusCodeError(ua.StatusCodes.BadSessionIdInvalid)
        return session

    def resolve(self, token: ua.NodeId, connection: TcpConnection) -> Session:
        """Find the session a request belongs to; it must be active and bound to the channel of the request.

        Raises
        ------
        StatusCodeError
            BadSessionIdInvalid, BadSecureChannelIdInvalid or BadSessionNotActivated.
        """
        session = self.find(token)
        if session.connection is not connection:
            raise StatusCodeError(ua.StatusCodes.BadSecureChannelIdInvalid)
        if not session.is_activated:
            self.remove(session)
            raise StatusCodeError(ua.StatusCodes.BadSessionNotActivated)
        session.last_seen = time.monotonic()
        return session

    def remove(self, session: Session) -> None:
        """Forget a session."""
        session.closed = True
        session.publish_requests.clear()
        self._sessions.pop(session.token, None)

    def detach(self, connection: TcpConnection) -> list[Session]:
        """Take a lost connection off its sessions; those that no user had logged in to are forgotten."""
        detached = [session for session in self._sessions.values() if session.connection is connection]
        for session in detached:
            session.attach(None)
            if not session.is_activated:
                self.remove(session)
        return [session for session in detached if session.is_activated]

    def expired(self) -> list[Session]:
        """Sessions that have not been heard of for longer than their timeout."""
        now = time.monotonic()
        return [s for s in self._sessions.values() if now - s.last_seen > s.timeout_s]
