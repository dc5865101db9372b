"""Messages of a subscription that were sent and not acknowledged: they can be sent again (Part 4, 5.14.1)."""

from collections import OrderedDict
from typing import Final

MAX_MESSAGES: Final = 256
"""Messages kept until they are acknowledged."""
MAX_BYTES: Final = 512 * 1024
"""The same in bytes; the last message is kept whatever its length."""


class RetransmissionQueue:
    """Keeps messages by their sequence number; the oldest gives way."""

    def __init__(self) -> None:
        self._messages: OrderedDict[int, bytes] = OrderedDict()
        self._bytes = 0

    def keep(self, sequence: int, message: bytes) -> None:
        """Keep a message that is sent."""
        self._messages[sequence] = message
        self._bytes += len(message)
        while len(self._messages) > MAX_MESSAGES or (len(self._messages) > 1 and self._bytes > MAX_BYTES):
            self._bytes -= len(self._messages.popitem(last=False)[1])

    def acknowledge(self, sequence: int) -> bool:
        """Forget a message that the client has; whether it was there."""
        message = self._messages.pop(sequence, None)
        self._bytes -= len(message or b"")
        return message is not None

    def message(self, sequence: int) -> bytes | None:
        """Find a message; None where it is not kept."""
        return self._messages.get(sequence)

    def sequence_numbers(self) -> list[int]:
        """Sequence numbers of what is kept, the oldest first."""
        return list(self._messages)
