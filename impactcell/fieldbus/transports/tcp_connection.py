"""One Modbus TCP connection: a window of requests in flight, and nothing unchecked is ever used.

A reply counts only if transaction, unit, function and length are those of its request. At the first one that
is not, and at a timeout, the connection is given up for good, so that what still comes on it can never be
taken for an answer. A disconnect fails all that is pending at once.
"""

import asyncio
import math
import socket
from collections import deque
from collections.abc import Sequence
from typing import Final

from impactcell.errors import (
    ConnectionLostError,
    FieldbusError,
    LinkError,
    ModbusExceptionError,
    NoAnswerError,
    ProtocolError,
)
from impactcell.fieldbus.codec import BUSY, check_reply
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.request_batching import Exchange, RequestBatch, join_queue
from impactcell.fieldbus.transports.batch_in_flight import BatchInFlight
from impactcell.fieldbus.transports.mbap import FrameReader
from impactcell.fieldbus.transports.request_window import RequestWindow
from impactcell.fieldbus.transports.transaction_ids import TransactionIds

BUSY_PAUSE_S: Final = 0.02
"""How long a device that said busy is left alone; it is asked again until the timeout has passed."""
_QUICKACK: Final[int | None] = getattr(socket, "TCP_QUICKACK", None)
_RECEIVED_AT_ONCE: Final = 65_536
"""Bytes taken from the socket at a time: some 250 frames of full length."""


class TcpConnection(asyncio.BufferedProtocol):
    """One connection, from its making to its loss; it is never used again after that.

    Attributes
    ----------
    round_trip_s : float
        Time between the last request of the last exchange and its reply; nan before the first.
    lost : asyncio.Event
        Set once the socket is gone.
    """

    def __init__(self, link: ModuleLink, transactions: TransactionIds, window: RequestWindow) -> None:
        self.link = link
        self.window = window
        self.round_trip_s = float("nan")
        self.lost = asyncio.Event()
        self._loop = asyncio.get_running_loop()
        self._transactions = transactions
        self._transport: asyncio.Transport | None = None
        self._socket: socket.socket | None = None
        self._received = memoryview(bytearray(_RECEIVED_AT_ONCE))
        self._reader = FrameReader()
        self._waiting: deque[RequestBatch] = deque()
        self._in_flight: list[BatchInFlight] = []
        self._requests_in_flight = 0
        self._together = False
        self._busy: dict[asyncio.TimerHandle, RequestBatch] = {}
        self._unconfirmed: list[Exchange] = []
        self._answered_s = -math.inf
        self._timeout_timer: asyncio.TimerHandle | None = None
        self._pause_timer: asyncio.TimerHandle | None = None

    @property
    def open(self) -> bool:
        """Whether requests can be sent."""
        return self._transport is not None

    def submit(self, batches: Sequence[RequestBatch], *, first: bool = False) -> None:
        """Send `batches` as the window allows; `first`: before all that waits."""
        if self._transport is None:
            raise LinkError(f"{self.link}: not connected")
        join_queue(self._waiting, batches, first=first)
        self._send_waiting()

    def fail(self, error: FieldbusError) -> None:
        """Close the connection and fail all that is pending."""
        if self._in_flight and self._together:
            self.window.fail(str(error))
        for handle in (self._timeout_timer, self._pause_timer, *self._busy):
            if handle is not None:
                handle.cancel()
        pending = [*(flight.batch for flight in self._in_flight), *self._busy.values(), *self._waiting]
        self._timeout_timer = self._pause_timer = None
        self._busy.clear()
        self._in_flight.clear()
        self._requests_in_flight = 0
        self._waiting.clear()
        transport, self._transport = self._transport, None
        if transport is not None:
            transport.abort()
        for exchange in (*self._unconfirmed, *(batch.exchange for batch in pending)):
            exchange.fail(error)
        self._unconfirmed.clear()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take over a fresh connection (called by asyncio)."""
        assert isinstance(transport, asyncio.Transport)  # noqa: S101 - TCP and TLS both give one
        self._transport = transport
        if _QUICKACK is not None:
            self._socket = transport.get_extra_info("socket")

    def get_buffer(self, sizehint: int) -> memoryview:  # noqa: ARG002 - asyncio's signature
        """Return where to receive (called by asyncio)."""
        return self._received

    def buffer_updated(self, nbytes: int) -> None:
        """Match replies with requests and send the next ones (called by asyncio)."""
        if self._transport is None:
            return
        try:
            rest = self._consume_good_replies(self._reader.take(bytes(self._received[:nbytes])))
            if rest:
                for transaction, unit, pdu in self._reader.feed(rest):
                    self._handle_frame(transaction, unit, pdu)
            if not self._reader.pending and not self._in_flight:
                self._confirm()
        except ProtocolError as error:
            self.fail(ProtocolError(f"{self.link}: {error}"))
            return
        if self._reader.pending and not self._in_flight:
            self.fail(ProtocolError(f"{self.link}: more bytes than were asked for"))
            return
        if self.link.pause_s and self._pause_timer is None:
            self._pause_timer = self._loop.call_later(self.link.pause_s, self._end_pause)
        if (
            not self._send_waiting()
            and self._in_flight
            and self._socket is not None
            and _QUICKACK is not None
        ):
            # A peer that holds back small replies waits for this; else the next request says it as well. The
            # system falls back to delayed acknowledgements by itself, so it is set anew each time.
            self._socket.setsockopt(socket.IPPROTO_TCP, _QUICKACK, 1)

    def connection_lost(self, exc: Exception | None) -> None:
        """Fail what is pending (called by asyncio)."""
        self.lost.set()
        if self._transport is not None:
            why = exc.strerror if isinstance(exc, OSError) and exc.strerror else exc
            self.fail(ConnectionLostError(f"{self.link}: connection lost{f': {why}' if why else ''}"))

    def _send_waiting(self) -> bool:
        """Send what the window allows, in one write; return whether there was anything."""
        if self._transport is None or self._pause_timer is not None:
            return False
        frames: list[bytes] = []
        self._together = self._together and bool(self._in_flight)
        now = self._loop.time()
        while self._waiting and (room := self.window.size - self._requests_in_flight) > 0:
            batch = self._waiting[0]
            if batch.exchange.done.done():  # its block has failed, or nobody waits for it any more
                self._waiting.popleft()
                continue
            if len(batch.requests) > room:
                batch = batch.split(room)
            else:
                self._waiting.popleft()
            flight = BatchInFlight(
                batch, self.link.device_id, self._fresh_transactions(len(batch.requests)), now
            )
            self._in_flight.append(flight)
            self._requests_in_flight += len(batch.requests)
            frames += flight.frames()
        if frames:
            self._together = self._together or self._requests_in_flight > 1
            self._transport.write(b"".join(frames))
            if self._timeout_timer is None:
                self._timeout_timer = self._loop.call_later(self.link.timeout_s, self._check_timeout)
        return bool(frames)

    def _fresh_transactions(self, count: int) -> tuple[bytes, ...]:
        """Draw transaction ids, none of which is in flight."""
        drawn = self._transactions.draw(count)
        for flight in self._in_flight:
            if not set(drawn).isdisjoint(flight.transactions):
                return self._fresh_transactions(count)
        return drawn

    def _check_timeout(self) -> None:
        """Give up if the oldest request has waited too long since the last reply; else look again.

        A device, or a gateway before a serial line, answers one after the other: what is behind in a window
        waits for all before it.
        """
        self._timeout_timer = None
        if not self._in_flight:
            return
        oldest = self._in_flight[0]  # they stay in the order of sending
        left_s = max(oldest.sent_s, self._answered_s) + self.link.timeout_s - self._loop.time()
        if left_s > 0.0:
            self._timeout_timer = self._loop.call_later(left_s, self._check_timeout)
            return
        timeout = f"within {self.link.patience}"
        if self._requests_in_flight > 1:
            timeout += f", of {self._requests_in_flight} in flight (window {self.window.size})"
        self.fail(
            NoAnswerError(f"{self.link}: no answer to {oldest.batch.requests[0].description} {timeout}")
        )

    def _consume_good_replies(self, stream: bytes) -> bytes:
        """Use the good replies at the front of `stream`, up to anything unusual; return the rest."""
        at = 0
        while self._in_flight:
            flight = self._in_flight[0]
            count, at, data = flight.match_replies(stream, at)
            if not count:
                break
            self._accept_replies(self._take_from_flight(flight, 0, count), data)
        return stream[at:]

    def _handle_frame(self, number: int, unit: int, pdu: bytes) -> None:
        """Use one reply; raises ProtocolError, with the request still open, where it is not a good one."""
        transaction = number.to_bytes(2, "big")
        flight = next((each for each in self._in_flight if transaction in each.transactions), None)
        if flight is None:
            raise ProtocolError(f"an answer to transaction {number}, which is not open")
        at = flight.transactions.index(transaction)
        request = flight.batch.requests[at]
        if unit != self.link.device_id:
            raise ProtocolError(f"an answer from device {unit} to {request.description}")
        try:
            data = check_reply(request, pdu)
        except ModbusExceptionError as exception:
            self._confirm()
            self._handle_exception(self._take_from_flight(flight, at, 1), exception)
            return
        if at or flight is not self._in_flight[0]:
            self.window.give_up(f"{self.link}: answers come out of order")
        self._accept_replies(self._take_from_flight(flight, at, 1), data)

    def _take_from_flight(self, flight: BatchInFlight, first: int, count: int) -> BatchInFlight:
        """Take `count` requests of `flight`, from `first` on, out of what is in flight."""
        self._requests_in_flight -= count
        self._answered_s = self._loop.time()
        at = self._in_flight.index(flight)
        if first:
            self._in_flight.insert(at, flight.split(first))
            at += 1
        if count < len(flight.transactions):
            return flight.split(count)
        return self._in_flight.pop(at)

    def _accept_replies(self, answered: BatchInFlight, data: bytes) -> None:
        """Take the data of good replies."""
        if self._unconfirmed:
            self._confirm()
        batch = answered.batch
        exchange, count = batch.exchange, len(batch.requests)
        if exchange.done.done():  # it has ended, and what came until then may be in use
            return
        if batch.block is not None:
            batch.block.fill(batch.first, count, data)
        exchange.unanswered -= count
        self.window.answered += count
        if not exchange.unanswered:
            self.round_trip_s = self._loop.time() - answered.sent_s
            self._unconfirmed.append(exchange)

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

    def _handle_exception(self, answered: BatchInFlight, exception: ModbusExceptionError) -> None:
        """Ask a busy device again for the one request that it refused; else end its exchange."""
        batch = answered.batch
        exchange = batch.exchange
        first_sent_s = exchange.first_sent_s.setdefault(batch.requests[0], answered.sent_s)
        if exception.code == BUSY and self._loop.time() + BUSY_PAUSE_S < first_sent_s + self.link.timeout_s:

            def again() -> None:
                del self._busy[handle]
                self._waiting.appendleft(batch)
                self._send_waiting()

            handle = self._loop.call_later(BUSY_PAUSE_S, again)
            self._busy[handle] = batch
            return
        exchange.fail(ModbusExceptionError(f"{self.link}: {exception}", exception.code))

    def _end_pause(self) -> None:
        self._pause_timer = None
        self._send_waiting()
