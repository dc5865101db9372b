"""One Modbus TCP connection: a window of requests in flight, and nothing unchecked is ever used.

A reply counts only if transaction, unit, function and length are those of its request. At the first one that
is not, and at a timeout, the connection is given up for good, so that what still comes on it can never be
taken for an answer. A disconnect fails all that is pending at once.
"""

import asyncio
import socket
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from impactcell.errors import FieldbusError, LinkError, ModbusExceptionError, ProtocolError
from impactcell.fieldbus.codec import BUSY, FrameReader, Request, check_reply
from impactcell.fieldbus.link import ModuleLink

BUSY_PAUSE_S: Final = 0.02
"""How long a device that said busy is left alone; it is asked again until the timeout has passed."""
_QUICKACK: Final[int | None] = getattr(socket, "TCP_QUICKACK", None)


class Exchange:
    """Requests that are answered together: what a block still lacks, or one write.

    `data` receives registers at `Part.offset`; `missing` holds the offsets not answered yet.
    """

    __slots__ = ("data", "done", "missing")

    def __init__(self, data: bytearray, missing: set[int]) -> None:
        self.data = data
        self.missing = missing
        self.done: asyncio.Future[None] = asyncio.get_running_loop().create_future()

    def fail(self, error: FieldbusError) -> None:
        """End it with an error, unless it has ended already."""
        if not self.done.done():
            self.done.set_exception(error)


@dataclass(slots=True, eq=False)
class Part:
    """One request of an exchange, where its registers go, and when it was first and last sent."""

    exchange: Exchange
    request: Request
    offset: int
    first_sent_s: float = 0.0
    sent_s: float = 0.0


class Connection(asyncio.Protocol):
    """One connection, from its making to its loss; it is never used again after that.

    Attributes
    ----------
    round_trip_s : float
        Time between the last request of the last exchange and its reply; nan before the first.
    lost : asyncio.Event
        Set once the socket is gone.
    """

    def __init__(self, link: ModuleLink, transactions: Iterator[bytes]) -> None:
        self.link = link
        self.round_trip_s = float("nan")
        self.lost = asyncio.Event()
        self._loop = asyncio.get_running_loop()
        self._transactions = transactions
        self._transport: asyncio.Transport | None = None
        self._socket: socket.socket | None = None
        self._reader = FrameReader()
        self._waiting: deque[Part] = deque()
        self._flying: dict[bytes, Part] = {}
        self._busy: dict[asyncio.TimerHandle, Part] = {}
        self._unconfirmed: list[Exchange] = []
        self._timer: asyncio.TimerHandle | None = None
        self._resting: asyncio.TimerHandle | None = None

    @property
    def open(self) -> bool:
        """Whether requests can be sent."""
        return self._transport is not None

    def submit(self, parts: Iterable[Part], *, first: bool = False) -> None:
        """Send `parts` as the window allows; `first`: before all that waits."""
        if self._transport is None:
            raise LinkError(f"{self.link}: not connected")
        if first:
            self._waiting.extendleft(parts)
        else:
            self._waiting.extend(parts)
        self._pump()

    def give_up(self, error: FieldbusError) -> None:
        """Close the connection and fail all that is pending."""
        for handle in (self._timer, self._resting, *self._busy):
            if handle is not None:
                handle.cancel()
        pending = [*self._flying.values(), *self._busy.values(), *self._waiting]
        self._timer = self._resting = None
        self._busy.clear()
        self._flying.clear()
        self._waiting.clear()
        transport, self._transport = self._transport, None
        if transport is not None:
            transport.abort()
        for exchange in (*self._unconfirmed, *(part.exchange for part in pending)):
            exchange.fail(error)
        self._unconfirmed.clear()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take over a fresh connection (called by asyncio)."""
        assert isinstance(transport, asyncio.Transport)  # noqa: S101 - TCP and TLS both give one
        self._transport = transport
        if _QUICKACK is not None:
            self._socket = transport.get_extra_info("socket")

    def data_received(self, data: bytes) -> None:
        """Match replies with requests and send the next ones (called by asyncio)."""
        if self._transport is None:
            return
        if self._socket is not None and _QUICKACK is not None:
            # The system falls back to delayed acknowledgements by itself, so this is set anew on each read.
            self._socket.setsockopt(socket.IPPROTO_TCP, _QUICKACK, 1)
        try:
            rest = self._take_good(self._reader.take(data))
            for transaction, unit, pdu in self._reader.feed(rest):
                self._answer(transaction, unit, pdu)
            if not self._reader.pending and not self._flying:
                self._confirm()
        except ProtocolError as error:
            self.give_up(ProtocolError(f"{self.link}: {error}"))
            return
        if self._reader.pending and not self._flying:
            self.give_up(ProtocolError(f"{self.link}: more bytes than were asked for"))
            return
        if self.link.pause_s and self._resting is None:
            self._resting = self._loop.call_later(self.link.pause_s, self._rested)
        else:
            self._pump()

    def connection_lost(self, exc: Exception | None) -> None:
        """Fail what is pending (called by asyncio)."""
        self.lost.set()
        if self._transport is not None:
            self.give_up(LinkError(f"{self.link}: connection lost{f': {exc}' if exc else ''}"))

    def _pump(self) -> None:
        """Send what the window allows, in one write."""
        if self._transport is None or self._resting is not None:
            return
        frames: list[bytes] = []
        now = self._loop.time()
        while self._waiting and len(self._flying) < self.link.window:
            part = self._waiting.popleft()
            if part.exchange.done.done():  # its block has failed, or nobody waits for it any more
                continue
            part.sent_s = now
            part.first_sent_s = part.first_sent_s or now
            transaction = next(self._transactions)
            while transaction in self._flying:
                transaction = next(self._transactions)
            self._flying[transaction] = part
            frames += (transaction, part.request.tail)
        if frames:
            self._transport.write(b"".join(frames))
            if self._timer is None:
                self._timer = self._loop.call_later(self.link.timeout_s, self._check_time)

    def _check_time(self) -> None:
        """Give up if the oldest request has waited too long; else look again when it will have."""
        self._timer = None
        if not self._flying:
            return
        oldest = next(iter(self._flying.values()))  # a dictionary keeps the order of sending
        left_s = oldest.sent_s + self.link.timeout_s - self._loop.time()
        if left_s > 0.0:
            self._timer = self._loop.call_later(left_s, self._check_time)
            return
        timeout = f"within {self.link.timeout_s:g} s"
        self.give_up(LinkError(f"{self.link}: no answer to {oldest.request.what} {timeout}"))

    def _take_good(self, data: bytes) -> bytes:
        """Use the good replies at the front of `data` up to the first that is not, or not whole; the rest.

        Nearly all are good, and of those everything but the data is known beforehand: they are compared with
        it and need no taking apart.
        """
        flying, at, size = self._flying, 0, len(data)
        while (part := flying.get(transaction := data[at : at + 2])) is not None:
            head, length = part.request.reply_head, part.request.data_length
            end = at + 2 + len(head) + length
            if end > size or not data.startswith(head, at + 2):
                break
            self._use(transaction, part, data[end - length : end])
            at = end
        return data[at:]

    def _use(self, transaction: bytes, part: Part, data: bytes) -> None:
        """Take the data of a good reply."""
        if self._unconfirmed:
            self._confirm()
        del self._flying[transaction]
        exchange, offset = part.exchange, part.offset
        exchange.data[offset : offset + len(data)] = data
        exchange.missing.discard(offset)
        if not exchange.missing:
            self.round_trip_s = self._loop.time() - part.sent_s
            self._unconfirmed.append(exchange)

    def _answer(self, number: int, unit: int, pdu: bytes) -> None:
        """Use one reply; raises ProtocolError, with the request still open, where it is not a good one."""
        transaction = number.to_bytes(2, "big")
        part = self._flying.get(transaction)
        if part is None:
            raise ProtocolError(f"an answer to transaction {number}, which is not open")
        if unit != self.link.device_id:
            raise ProtocolError(f"an answer from device {unit} to {part.request.what}")
        try:
            data = check_reply(part.request, pdu)
        except ModbusExceptionError as refused:
            self._confirm()
            del self._flying[transaction]
            self._refused(part, refused)
            return
        self._use(transaction, part, data)

    def _confirm(self) -> None:
        """Hand over what is complete, now that the stream is known to be in step.

        A frame that lost bytes fills up with the first ones of the next frame and looks whole; only what
        comes after it shows that, or that the next frame, if it was used up to its end, never comes. So a
        reply counts once another good reply follows it, or nothing does and no other is due.
        """
        for exchange in self._unconfirmed:
            if not exchange.done.done():
                exchange.done.set_result(None)
        self._unconfirmed.clear()

    def _refused(self, part: Part, refused: ModbusExceptionError) -> None:
        if (
            refused.code == BUSY
            and self._loop.time() + BUSY_PAUSE_S < part.first_sent_s + self.link.timeout_s
        ):

            def again() -> None:
                del self._busy[handle]
                self._waiting.appendleft(part)
                self._pump()

            handle = self._loop.call_later(BUSY_PAUSE_S, again)
            self._busy[handle] = part
            return
        part.exchange.fail(ModbusExceptionError(f"{self.link}: {refused}", refused.code))

    def _rested(self) -> None:
        self._resting = None
        self._pump()
