"""A batch of requests in flight over Modbus TCP: requests alike and side by side go through together.

Of a good reply everything but its data is known beforehand, and nearly all replies are good and come in
order. So the replies to a batch are compared with what they must be, and their data copied, in one go.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from impactcell.fieldbus.request_batching import RequestBatch
from impactcell.fieldbus.transports.mbap import head_after_transaction


@lru_cache(maxsize=512)
def _layout(head: int, data: int) -> np.dtype[Any]:
    """Layout of a reply: as many bytes that are known beforehand, and of data."""
    return np.dtype([("head", f"V{head}"), ("data", f"V{data}")])


@lru_cache(maxsize=512)
def _reply_head(unit: int, reply_length: int, prefix: bytes) -> tuple[bytes, int]:
    """Give what stands between the transaction of a good reply and its data, and the length of that data."""
    return head_after_transaction(unit, reply_length) + prefix, reply_length - len(prefix)


@dataclass(slots=True, eq=False)
class BatchInFlight:
    """A batch in flight to `unit`, or what is left of it, sent at `sent_s` under `transactions`."""

    batch: RequestBatch
    unit: int
    transactions: tuple[bytes, ...]
    sent_s: float

    def frames(self) -> Iterator[bytes]:
        """Yield the requests as they go out."""
        head = head_after_transaction(self.unit, len(self.batch.requests[0].pdu))
        for transaction, request in zip(self.transactions, self.batch.requests, strict=True):
            yield transaction + head + request.pdu

    def match_replies(self, stream: bytes, at: int) -> tuple[int, int, bytes]:
        """Look whether `stream` goes on, from `at`, with good replies to the first requests.

        Returns
        -------
        int
            How many; none at all if there is anything unusual among as many as are there.
        int
            Where they end.
        bytes
            Their data.
        """
        request = self.batch.requests[0]
        if request.measure is not None:
            return 0, at, b""
        head, data_length = _reply_head(self.unit, request.reply_length, request.reply_prefix)
        size = 2 + len(head) + data_length
        count = min(len(self.transactions), (len(stream) - at) // size)
        end = at + count * size
        if count == 1:
            if stream.startswith(self.transactions[0] + head, at):
                return 1, end, stream[end - data_length : end]
        elif count:
            replies = np.frombuffer(stream, _layout(2 + len(head), data_length), count, at)
            if replies["head"].tobytes() == head.join(self.transactions[:count]) + head:
                return count, end, replies["data"].tobytes()
        return 0, at, b""

    def split(self, count: int) -> "BatchInFlight":
        """Keep all but the first `count` requests, and return those."""
        front = BatchInFlight(self.batch.split(count), self.unit, self.transactions[:count], self.sent_s)
        self.transactions = self.transactions[count:]
        return front
