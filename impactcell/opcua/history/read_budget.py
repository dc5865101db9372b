"""What one HistoryRead may take: so many values, and so long; what is left goes on by continuation point."""

import time
from typing import Final

from impactcell.opcua.loop_share import LoopShare, Turns

VALUES_PER_ANSWER: Final = 10_000
"""Values, events and aggregates of all nodes in one answer: some 300 kB, and 10 ms of encoding in slices."""
LONGEST_S: Final = 1.0
"""Time for one answer, seconds."""
SHARE_OF_HINT: Final = 0.5
"""Share of the time that the client gives by its TimeoutHint."""


class ReadBudget(LoopShare):
    """The budget of one HistoryRead; something is read in any case, so that whoever goes on gets on.

    Parameters
    ----------
    turns : Turns
    timeout_hint_ms : int
        Time in which the client wants its answer; 0 for any.
    """

    def __init__(self, turns: Turns, timeout_hint_ms: int) -> None:
        super().__init__(turns)
        longest_s = min(LONGEST_S, SHARE_OF_HINT * timeout_hint_ms / 1e3) if timeout_hint_ms else LONGEST_S
        self._until = time.monotonic() + longest_s
        self._has_read = False
        self._room = VALUES_PER_ANSWER

    @property
    def is_spent(self) -> bool:
        """Whether nothing more may be read for this answer."""
        return self._has_read and (self._room <= 0 or time.monotonic() > self._until)

    def room(self, limit: int) -> int:
        """How many of `limit` values still fit into the answer; one does in any case."""
        return max(min(limit, self._room), 1)

    async def spend(self, values: int) -> None:
        """Count what was read, and let others have their turn."""
        self._has_read = True
        self._room -= values
        await self.give_way()
