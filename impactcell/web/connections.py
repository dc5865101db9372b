"""Connections of browsers: how many there may be, how long one may take to ask, and to take an answer."""

import asyncio
from collections import Counter
from typing import Any, ClassVar, Final

from uvicorn.protocols.http.h11_impl import H11Protocol

MAX_CONNECTIONS: Final = 250
"""Connections at once, of all; one more is closed before it is read."""
MAX_PER_ADDRESS: Final = 100
"""Connections at once of one address: a proxy, or a person with many pages open."""
HEADER_S: Final = 10.0
"""How long a request's head may take to come, and a connection may wait without one."""
STALLED_S: Final = 30.0
"""How often is looked whether something has gone out of what is to: a connection ends where nothing has."""


class Connection(H11Protocol):
    """One connection; uvicorn's own has no limit of time before a request's head is whole, and after it."""

    _by_address: ClassVar[Counter[str]] = Counter()

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self._deadline: asyncio.TimerHandle | None = None
        self._address = ""
        self._look: asyncio.TimerHandle | None = None
        self._unsent: int | None = None
        """Bytes that were to go out at the last look; None where none were, or all have gone since."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a connection, or close it where there are too many."""
        super().connection_made(transport)
        address = self.client[0] if self.client else ""
        if len(self.connections) > MAX_CONNECTIONS or self._by_address[address] >= MAX_PER_ADDRESS:
            transport.abort()
            return
        self._address = address
        self._by_address[address] += 1
        self._wait_for_head()
        transport.set_write_buffer_limits(high=1)  # `resume_writing` says that all has gone out
        self._look = self.loop.call_later(STALLED_S, self._look_on)

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget it."""
        self._stop_waiting()
        if self._look is not None:
            self._look.cancel()
        if self._address:
            self._by_address[self._address] -= 1
            if not self._by_address[self._address]:
                del self._by_address[self._address]
            self._address = ""
        super().connection_lost(exc)

    def handle_events(self) -> None:
        """Read what has come; from the first byte after an answer on, the next head has its time too."""
        before = self.cycle
        super().handle_events()
        if self.cycle is not before:
            self._stop_waiting()
        elif getattr(before, "response_complete", True) and self._deadline is None:
            self._wait_for_head()

    def resume_writing(self) -> None:
        """Learn that all that was written has gone out."""
        super().resume_writing()
        self._unsent = None

    def _look_on(self) -> None:
        """Let go of who has taken nothing since the last look; a buffer below may hold what TLS has taken."""
        unsent, last = self.transport.get_write_buffer_size(), self._unsent
        if last is not None and unsent >= last:
            self.transport.abort()
            return
        self._unsent = unsent if unsent or self.transport.is_closing() else None
        self._look = self.loop.call_later(STALLED_S, self._look_on)

    def _wait_for_head(self) -> None:
        self._deadline = self.loop.call_later(HEADER_S, self._end_waiting)

    def _end_waiting(self) -> None:
        """End it; what has been answered before still goes out."""
        if self.cycle is None:
            self.transport.abort()
        elif not self.transport.is_closing():  # asyncio's TLS forgets a transport that is closed twice
            self.transport.close()

    def _stop_waiting(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None
