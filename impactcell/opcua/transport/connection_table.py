"""All connections of a server, and what they may hold together: by address and in all.

Who has logged in stays. Of those who have not, the one that has waited longest gives way to a newcomer once
it has had its time, the first from the address that has most of them: whoever only opens connections pushes
out his own.
"""

import time
from collections import Counter
from typing import Final, Protocol

from impactcell.opcua.host_interface import ServerLimits
from impactcell.opcua.loop_share import Turns

MAX_UNFINISHED_BYTES: Final = 32 * 1024 * 1024
"""Bytes of messages that have not come to their end, and of requests that wait, of all connections."""
MAX_UNFINISHED_BYTES_PER_ADDRESS: Final = 8 * 1024 * 1024
"""The same, of all connections from one address."""
MAX_UNSENT_BYTES: Final = 64 * 1024 * 1024
"""Answers that clients have not read yet, of all connections."""
MAX_UNSENT_BYTES_PER_ADDRESS: Final = 16 * 1024 * 1024
"""The same, of all connections from one address: four of the largest."""


class Connection(Protocol):
    """What the table has to know of a connection."""

    address: str
    has_session: bool
    since_s: float

    @property
    def unfinished_bytes(self) -> int:
        """Bytes that have come and are no request yet, or one that waits."""

    @property
    def unsent_bytes(self) -> int:
        """Bytes that the client has not read yet."""

    def give_way(self) -> None:
        """End at once: somebody else needs the place."""


class ConnectionTable:
    """Which connections there are, and whether one more is taken."""

    def __init__(self, limits: ServerLimits) -> None:
        self.turns = Turns()
        self._limits = limits
        self._connections: dict[Connection, None] = {}

    def __len__(self) -> int:
        return len(self._connections)

    def all(self) -> tuple[Connection, ...]:
        """Every connection, the oldest first."""
        return tuple(self._connections)

    def admit(self, newcomer: Connection) -> bool:
        """Take a connection in, if there is a place or one can be made."""
        limits, of_address = self._limits, self._of(newcomer.address)
        if len(of_address) >= limits.connections_per_address:
            is_free = self._make_place(of_address)
        elif len(self) >= limits.connections:
            is_free = self._make_place(self._of(self._busiest_address()))
        else:
            is_free = True
        if is_free:
            self._connections[newcomer] = None
        return is_free

    def discard(self, connection: Connection) -> None:
        """Forget a connection."""
        self._connections.pop(connection, None)

    def holds_too_much(self, connection: Connection) -> bool:
        """Whether the unfinished bytes of a connection are too many, with those of its address or of all."""
        if self._unfinished(self._of(connection.address)) > MAX_UNFINISHED_BYTES_PER_ADDRESS:
            return True
        return self._unfinished(self._connections) > MAX_UNFINISHED_BYTES

    def reads_too_little(self, connection: Connection) -> bool:
        """Whether a client leaves too much unread, with those of its address or with all."""
        if sum(c.unsent_bytes for c in self._of(connection.address)) > MAX_UNSENT_BYTES_PER_ADDRESS:
            return True
        return sum(c.unsent_bytes for c in self._connections) > MAX_UNSENT_BYTES

    @staticmethod
    def _unfinished(connections: "list[Connection] | dict[Connection, None]") -> int:
        return sum(connection.unfinished_bytes for connection in connections)

    def _of(self, address: str) -> list[Connection]:
        return [connection for connection in self._connections if connection.address == address]

    def _busiest_address(self) -> str:
        waiting = Counter(c.address for c in self._connections if not c.has_session)
        return waiting.most_common(1)[0][0] if waiting else ""

    def _make_place(self, among: list[Connection]) -> bool:
        """End the oldest connection without a session, where it has had its time."""
        oldest = next((connection for connection in among if not connection.has_session), None)
        if oldest is None or time.monotonic() - oldest.since_s < self._limits.undisturbed_s:
            return False
        self.discard(oldest)
        oldest.give_way()
        return True
