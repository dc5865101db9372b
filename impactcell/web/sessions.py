"""Who is logged in to the page: sessions that live in memory, end by themselves, and end with their user."""

import secrets
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

from impactcell.opcua.host_interface import UserDirectory
from impactcell.scada import Actor, Role

IDLE_S: Final = 1800.0
"""A session without a request for so long is over; a page that is open counts as one: it gets its frames, or
asks now and then while its tab is behind others."""
LONGEST_S: Final[Mapping[Role, float]] = {
    Role.OBSERVER: 30 * 86_400.0,
    Role.OPERATOR: 12 * 3600.0,
    Role.ENGINEER: 12 * 3600.0,
}
"""Longest session: a shift for who can change something, a month for a screen on the wall."""
MAX_SESSIONS: Final = 500
"""Sessions at once; the one that has been quiet longest gives way."""
TOKEN_BYTES: Final = 32
"""Random bytes of a token, 256 bits."""


def _token() -> str:
    return secrets.token_urlsafe(TOKEN_BYTES)


@dataclass(slots=True)
class BrowserSession:
    """One login; `csrf` is part of every form that it is shown."""

    actor: Actor
    user: object
    created_s: float
    last_seen_s: float
    token: str = field(default_factory=_token)
    csrf: str = field(default_factory=_token)


class SessionTable:
    """Sessions by their token.

    Parameters
    ----------
    users : UserDirectory
        A session ends as soon as its user's entry is another: removed, another role, another password.
    clock : callable, optional
        Seconds that only grow.
    """

    def __init__(self, users: UserDirectory, clock: Callable[[], float] = time.monotonic) -> None:
        self._users = users
        self._clock = clock
        self._sessions: dict[str, BrowserSession] = {}

    def begin(self, actor: Actor) -> BrowserSession:
        """Begin a session."""
        now = self._clock()
        for token in [t for t, session in self._sessions.items() if self._is_over(session, now)]:
            del self._sessions[token]
        while len(self._sessions) >= MAX_SESSIONS:
            del self._sessions[min(self._sessions, key=lambda token: self._sessions[token].last_seen_s)]
        session = BrowserSession(actor, self._users.find(actor.user), now, now)
        self._sessions[session.token] = session
        return session

    def find(self, token: str) -> BrowserSession | None:
        """Find a session that is not over, and count it as used."""
        session = self._sessions.get(token)
        if session is None:
            return None
        now = self._clock()
        if self._is_over(session, now) or self._users.find(session.actor.user) != session.user:
            del self._sessions[token]
            return None
        session.last_seen_s = now
        return session

    def end(self, session: BrowserSession) -> None:
        """End a session."""
        self._sessions.pop(session.token, None)

    @staticmethod
    def _is_over(session: BrowserSession, now: float) -> bool:
        return now - session.last_seen_s > IDLE_S or now - session.created_s > LONGEST_S[session.actor.role]
