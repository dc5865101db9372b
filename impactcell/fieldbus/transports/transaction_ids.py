"""Transaction ids: every attempt has one of its own, so that no late reply is taken for another's."""

import random
from functools import cache
from typing import Final

ID_COUNT: Final = 65_536
"""Different ids: 16 bits."""
_STRIDE: Final = 40_503
"""Odd, so that it visits all 16-bit numbers; 2^16 over the golden ratio, so that neighbours lie far apart."""


@cache
def _in_order() -> tuple[bytes, ...]:
    return tuple((number * _STRIDE % ID_COUNT).to_bytes(2, "big") for number in range(ID_COUNT))


class TransactionIds:
    """Transaction ids: each of the 65 536 once before any comes again.

    They start anywhere, so that a gateway's late reply to an earlier client is not for one of ours, and lie
    far apart, so that a peer that is off by a little never hits another request in flight.
    """

    __slots__ = ("_next",)

    def __init__(self) -> None:
        self._next = random.getrandbits(16)

    def draw(self, count: int) -> tuple[bytes, ...]:
        """Draw the next ids, as they stand on the wire."""
        first, end = self._next, self._next + count
        self._next = end % ID_COUNT
        ids = _in_order()
        return ids[first:end] if end <= ID_COUNT else ids[first:] + ids[: self._next]
