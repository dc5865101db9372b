"""Continuation points of Browse and HistoryRead: what a session may read on from, and when that ends.

A point is good for one request. It expires when it is used, when as many newer ones of its kind are kept for
its session as there may be, and with the session; there is no time of its own (Part 4, 7.9).
"""

import os
from collections import OrderedDict
from typing import Any, Final

from asyncua import ua

from impactcell.opcua.binary_codec import StatusCodeError

MAX_BROWSE_POINTS: Final = 20
"""Continuation points of Browse kept for one session; shown among the capabilities."""
MAX_HISTORY_POINTS: Final = 100
"""Continuation points of HistoryRead kept for one session: one for each node of the largest request."""


class ContinuationPoints:
    """Continuation points of one kind and one session; the oldest gives way when there are too many."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._states: OrderedDict[bytes, Any] = OrderedDict()

    def keep(self, state: object) -> bytes:
        """Keep what is needed to read on, and name it."""
        while len(self._states) >= self._most:
            self._states.popitem(last=False)
        point = os.urandom(16)
        self._states[point] = state
        return point

    def take(self, point: bytes) -> Any:
        """Take what was kept.

        Raises
        ------
        StatusCodeError
            BadContinuationPointInvalid.
        """
        if point not in self._states:
            raise StatusCodeError(ua.StatusCodes.BadContinuationPointInvalid)
        return self._states.pop(point)
