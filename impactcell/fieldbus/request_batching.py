"""What is asked for, whatever carries it: requests alike and side by side are kept together.

A transport takes `RequestBatch`es, puts the data of the replies into their blocks, and ends their `Exchange`.
"""

import asyncio
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from impactcell.errors import FieldbusError
from impactcell.fieldbus.codec import FunctionCode, Request, read_request
from impactcell.fieldbus.register_map.register_types import BIT_TABLES, WIRE
from impactcell.fieldbus.registers import Words

_READ_FUNCTION: Final = {
    "holding": FunctionCode.READ_HOLDING,
    "input": FunctionCode.READ_INPUT,
    "coil": FunctionCode.READ_COILS,
    "discrete": FunctionCode.READ_DISCRETE,
}


class Exchange:
    """Requests that are answered together.

    Attributes
    ----------
    done : Future
        Resolved once all are answered.
    unanswered : int
        Requests still without a good reply.
    first_sent_s : dict
        When a request that the device was too busy for was first sent.
    """

    __slots__ = ("done", "first_sent_s", "unanswered")

    def __init__(self) -> None:
        self.unanswered = 0
        self.first_sent_s: dict[Request, float] = {}
        self.done: asyncio.Future[None] = asyncio.get_running_loop().create_future()

    def fail(self, error: FieldbusError) -> None:
        """End it with an error, unless it has ended already."""
        if not self.done.done():
            self.done.set_exception(error)


@lru_cache(maxsize=256)
def _requests(table: str, address: int, count: int, step: int) -> tuple[Request, ...]:
    function = _READ_FUNCTION[table]
    return tuple(
        read_request(function, address + first, min(step, count - first)) for first in range(0, count, step)
    )


class PartialBlock:
    """A block of registers, as far as it has been read, `step` registers a request.

    Of coils and discrete inputs each is a word, 0 or 1.
    """

    __slots__ = ("_answered", "_data", "address", "count", "step", "table")

    def __init__(self, address: int, count: int, table: str, step: int) -> None:
        self.address = address
        self.count = count
        self.table = table
        self.step = step
        self._data = bytearray(2 * count)
        self._answered = bytearray(-(-count // step))

    @property
    def missing(self) -> int:
        """Number of requests that have not been answered."""
        return self._answered.count(0)

    def words(self) -> Words:
        """Return the registers, shape (count,), dtype `WIRE`; zero where they are missing."""
        return np.frombuffer(self._data, dtype=WIRE)

    def batches(self, exchange: Exchange) -> Iterator["RequestBatch"]:
        """Yield the requests that have not been answered, those together that are alike and side by side."""
        requests = _requests(self.table, self.address, self.count, self.step)
        alike = self.count // self.step
        end = 0
        while (first := self._answered.find(0, end)) >= 0:
            limit = alike if first < alike else len(requests)
            end = self._answered.find(1, first, limit)
            end = limit if end < 0 else end
            yield RequestBatch(exchange, self, first, requests[first:end])

    def fill(self, first: int, count: int, data: bytes) -> None:
        """Put in the data of the replies to `count` requests from number `first` on."""
        at = 2 * self.step * first
        if self.table in BIT_TABLES:
            data = self._words_of_bits(first, count, data)
        self._data[at : at + len(data)] = data
        self._answered[first : first + count] = b"\1" * count

    def _words_of_bits(self, first: int, count: int, data: bytes) -> bytes:
        """Give a word for each bit; the first is the least significant of the first byte of its reply."""
        replies = np.frombuffer(data, np.uint8).reshape(count, -1)
        bits = np.unpackbits(replies, axis=1, bitorder="little")
        asked = min(self.step, self.count - self.step * first)
        return bits[:, :asked].astype(WIRE).tobytes()


class ReplyData:
    """Where the data of a reply go that is no block of registers."""

    __slots__ = ("data",)

    def __init__(self) -> None:
        self.data = b""

    def fill(self, first: int, count: int, data: bytes) -> None:  # noqa: ARG002 - as of a block
        """Take the data of the only request."""
        self.data = data


@dataclass(slots=True, eq=False)
class RequestBatch:
    """Requests alike but for their address, from number `first` of `block` on; a write has no block."""

    exchange: Exchange
    block: PartialBlock | ReplyData | None
    first: int
    requests: tuple[Request, ...]

    def split(self, count: int) -> "RequestBatch":
        """Keep all but the first `count` requests, and return those."""
        front = RequestBatch(self.exchange, self.block, self.first, self.requests[:count])
        self.first += count
        self.requests = self.requests[count:]
        return front


def join_queue(waiting: deque[RequestBatch], batches: Sequence[RequestBatch], *, first: bool) -> None:
    """Let batches wait in order, `first` before all that waits; their exchanges count their requests."""
    for batch in batches:
        batch.exchange.unanswered += len(batch.requests)
    if first:
        waiting.extendleft(batches)
    else:
        waiting.extend(batches)
