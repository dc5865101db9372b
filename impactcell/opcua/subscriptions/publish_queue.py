"""Publish requests of a session that wait for something to say (Part 4, 5.14.5), or end without it."""

import time
from typing import Final

from asyncua import ua

from impactcell.opcua.binary_codec import service_fault
from impactcell.opcua.sessions.session_table import PublishRequest, Session

MAX_PUBLISH_REQUESTS: Final = 100
"""Publish requests of one session that wait; beyond, the oldest is answered with a fault."""


def wait_in_line(session: Session, request: PublishRequest) -> None:
    """Let a request wait behind the others."""
    _drop_expired(session)
    session.publish_requests.append(request)
    if len(session.publish_requests) > MAX_PUBLISH_REQUESTS:
        _fault_oldest(session, ua.StatusCodes.BadTooManyPublishRequests)


def return_all(session: Session) -> None:
    """Answer every request of a session that has no subscription any more."""
    while session.publish_requests and session.connection is not None:
        _fault_oldest(session, ua.StatusCodes.BadNoSubscription)


def _drop_expired(session: Session) -> None:
    """Answer those that have waited as long as their client gave them."""
    now = time.monotonic()
    while session.publish_requests and session.publish_requests[0].expires < now:
        _fault_oldest(session, ua.StatusCodes.BadTimeout)


def _fault_oldest(session: Session, code: int) -> None:
    """Answer the one that has waited longest with a fault."""
    oldest = session.publish_requests.popleft()
    if session.connection is not None:
        session.connection.respond(oldest.request_id, oldest.handle, service_fault(oldest.handle, code))
