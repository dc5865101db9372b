"""Connections of browsers: how many there may be, and how long one may take to say what it wants."""

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


class Connection(H11Protocol):
    """One connection; uvicorn's own has no limit of time before a request's head is whole."""

    _by_address: ClassVar[Counter[str]] = Counter()

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self._deadline: asyncio.TimerHandle | None = None
        self._address = ""

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

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget it."""
        self._stop_waiting()
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

    def _wait_for_head(self) -> None:
        self._deadline = self.loop.call_later(HEADER_S, self.transport.abort)

    def _stop_waiting(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None
