"""One TCP connection: frames in, frames out, and an Error message for whatever is wrong.

Mended: asyncua leaves a malformed Hello unanswered, closes without a word on most faults, keeps what it
cannot parse in its buffer for ever, waits without end for a peer that sends half a message, and lets the
output of a client that does not read grow without bound.
"""

import asyncio
import contextlib
import logging
import socket
import time
from typing import Final, Protocol, cast

from asyncua import ua

from impactcell.opcua.binary_codec import DecodingError, StatusCodeError, encode, service_fault
from impactcell.opcua.host_interface import ServerLimits
from impactcell.opcua.loop_share import LoopShare
from impactcell.opcua.transport.connection_table import ConnectionTable
from impactcell.opcua.transport.message_frames import HEADER, FrameStream
from impactcell.opcua.transport.secure_channel import (
    MAX_CHUNK,
    ChannelSecurity,
    SecureChannel,
    SecureChannelError,
)

_log = logging.getLogger(__name__)

MAX_QUEUED_CHUNKS: Final = 64
"""Chunks read ahead of the one being answered; beyond, reading pauses."""
LINGER_S: Final = 1.0
"""Seconds that a peer has to read why its connection ends."""
MAX_QUEUED_BYTES: Final = 4 * MAX_CHUNK
"""Bytes read ahead; beyond, reading pauses."""
MAX_UNSENT_BYTES: Final = 4 * 1024 * 1024
"""Output a client may leave unread, bytes."""


class RequestHandler(Protocol):
    """What handles the requests of a connection."""

    async def handle(self, connection: "TcpConnection", request_id: int, body: bytes) -> None:
        """Answer one request."""

    def disconnected(self, connection: "TcpConnection") -> None:
        """Learn that the connection has gone."""


class TcpConnection(asyncio.Protocol):
    """The server's end of one TCP connection."""

    def __init__(
        self,
        handler: RequestHandler,
        channels: ChannelSecurity,
        limits: ServerLimits,
        table: ConnectionTable,
    ) -> None:
        self._handler = handler
        self._limits = limits
        self._table = table
        self._stream = FrameStream()
        self._frames: asyncio.Queue[tuple[ua.Header, bytes] | None] = asyncio.Queue()
        self._transport: asyncio.Transport | None = None
        self._task: asyncio.Task[None] | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._admitted = False
        self._paused = False
        self._discards = False
        self._queued_bytes = 0
        self.share = LoopShare(table.turns)
        self.since_s = time.monotonic()
        self.channel = SecureChannel(channels)
        self.address = ""
        self.local_address: tuple[str, int] | None = None
        self.has_session = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take the connection, or refuse it where there are too many."""
        self._transport = cast("asyncio.Transport", transport)
        name = self._transport.get_extra_info("peername")
        self.address = str(name[0]) if name else ""
        self.local_address = self._transport.get_extra_info("sockname")
        if not self._table.admit(self):
            self.abort_with_error(
                ua.StatusCodes.BadTcpServerTooBusy, f"{len(self._table)} connections already"
            )
            return
        wire = self._transport.get_extra_info("socket")
        if wire is not None:
            # A peer that has vanished without a word is found within 30 s.
            wire.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            for option, value in (("TCP_KEEPIDLE", 15), ("TCP_KEEPINTVL", 5), ("TCP_KEEPCNT", 3)):
                if hasattr(socket, option):
                    wire.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)
        self._admitted = True
        loop = asyncio.get_running_loop()
        self._task = loop.create_task(self._serve(), name=f"opcua {self.address}")
        self._task.add_done_callback(self._served)
        self._timer = loop.call_later(self._limits.hello_s, self._too_slow)

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection; sessions and subscriptions live on."""
        self._table.discard(self)
        if self._timer is not None:
            self._timer.cancel()
        if self._task is not None:
            self._task.cancel()
        if self._admitted:
            self._handler.disconnected(self)
        self._transport = None
        self._stream.clear()
        self._frames = asyncio.Queue()
        self._queued_bytes = 0
        if exc is not None:
            _log.info("connection from %s lost: %s", self.address, exc)

    def _served(self, task: asyncio.Task[None]) -> None:
        # A task that was cancelled keeps its frames, and these keep the connection: without this link all is
        # freed at once, and not in the next full round of the garbage collector.
        self._task = None
        if not task.cancelled() and (error := task.exception()) is not None:
            _log.error("connection from %s", self.address, exc_info=error)
            self.close()

    def data_received(self, data: bytes) -> None:
        """Cut the stream into frames."""
        if self._discards:
            return
        try:
            for frame in self._stream.feed(data):
                self._frames.put_nowait(frame)
                self._queued_bytes += frame[0].packet_size
        except SecureChannelError as error:
            self.abort_with_error(error.code, str(error))
            return
        if self._is_ahead(1) and not self._paused and self._transport is not None:
            self._transport.pause_reading()
            self._paused = True
        if self.unfinished_bytes > MAX_CHUNK and self._table.holds_too_much(self):
            self.abort_with_error(ua.StatusCodes.BadTcpNotEnoughResources, "too many unfinished messages")

    def _is_ahead(self, share: int) -> bool:
        """Whether more has come than a share (1 for all of it, 2 for half) of what may wait."""
        return (
            self._frames.qsize() > MAX_QUEUED_CHUNKS // share
            or self._queued_bytes > MAX_QUEUED_BYTES // share
        )

    @property
    def unfinished_bytes(self) -> int:
        """Bytes that have come and are no request yet, or one that waits."""
        return len(self._stream) + self._queued_bytes + self.channel.unfinished_bytes

    @property
    def unsent_bytes(self) -> int:
        """Bytes that the client has not read yet."""
        return 0 if self._transport is None else self._transport.get_write_buffer_size()

    def give_way(self) -> None:
        """End at once: somebody else needs the place."""
        _log.info("connection from %s gives way: no session in time", self.address)
        self.channel.close()
        if self._transport is not None:
            self._transport.abort()

    async def _serve(self) -> None:
        while (frame := await self._frames.get()) is not None:
            if not self.has_session:  # of all those who have not logged in, one in each round of the loop
                await self.share.turns.wait()
            self.share.begin()
            self._queued_bytes -= frame[0].packet_size
            if self._paused and not self._is_ahead(2) and self._transport is not None:
                self._paused = False
                self._transport.resume_reading()
            try:
                await self._receive_chunk(*frame)
            except SecureChannelError as error:
                self.abort_with_error(error.code, str(error))
            except DecodingError as error:
                self.abort_with_error(ua.StatusCodes.BadDecodingError, str(error))
            except Exception:  # noqa: BLE001 - one connection's fault must not end the others
                _log.exception("request from %s", self.address)
                self.abort_with_error(ua.StatusCodes.BadInternalError, "internal error")
            await self.share.give_way()

    async def _receive_chunk(self, header: ua.Header, body: bytes) -> None:
        if header.MessageType == b"HEL":
            self._send(self.channel.acknowledge_hello(body))
            self._rearm(self._limits.activation_s)
            return
        message = self.channel.receive(header, body)
        if message is None:
            return
        if header.MessageType == b"OPN":
            await self.share.give_way()  # after one asymmetric operation, and before the next
            self._send(self.channel.open_secure_channel(message))
        elif header.MessageType == b"CLO":
            self.close()
        else:
            await self._handler.handle(self, message.request_id(), bytes(message.body()))

    def activated(self) -> None:
        """Let the connection stay: a session lives on it."""
        self.has_session = True
        self.channel.take_long_messages()
        if self._timer is not None:
            self._timer.cancel()

    def _rearm(self, delay_s: float) -> None:
        if self._timer is not None:
            self._timer.cancel()
        if not self.has_session:
            self._timer = asyncio.get_running_loop().call_later(delay_s, self._too_slow)

    def _too_slow(self) -> None:
        self.abort_with_error(ua.StatusCodes.BadTimeout, "no session in time")

    def respond(self, request_id: int, handle: int, body: bytes) -> None:
        """Send a response, or a fault where the client cannot take it."""
        try:
            data = self.channel.encode_response(body, request_id)
        except StatusCodeError as fault:
            data = self.channel.encode_response(service_fault(handle, fault.code), request_id)
        self._send(data)

    def _send(self, data: bytes) -> None:
        transport = self._transport
        if transport is None or transport.is_closing() or self._discards:
            return
        transport.write(data)
        unsent = transport.get_write_buffer_size()
        if unsent > MAX_UNSENT_BYTES or (unsent > MAX_CHUNK and self._table.reads_too_little(self)):
            _log.warning("%s does not read what it asked for; connection dropped", self.address)
            transport.abort()

    def abort_with_error(self, code: int, reason: str) -> None:
        """Send an Error message and close; the first one is the last word."""
        if self._transport is not None and not self._transport.is_closing() and not self._discards:
            level = logging.INFO if code == ua.StatusCodes.BadServerHalted else logging.WARNING
            # a client's words may stand in the reason: no line break or half character gets into the log
            _log.log(level, "connection from %s closed: %s", self.address, ascii(reason)[1:-1])
            message = ua.ErrorMessage(ua.StatusCode(code), ua.StatusCode(code).name)
            body = encode(message)
            self._transport.write(HEADER.pack(b"ERR", b"F", HEADER.size + len(body)) + body)
            self._linger(self._transport)
        self.channel.close()
        self._frames.put_nowait(None)

    def _linger(self, transport: asyncio.Transport) -> None:
        # Closing while the peer still sends would reset the connection, and the Error message might be lost:
        # what comes is thrown away until the peer has closed its end too.
        self._discards = True
        if self._paused:
            transport.resume_reading()
        try:
            transport.write_eof()
        except OSError:
            # The peer has gone already.
            transport.abort()
            return
        if self._timer is not None:
            self._timer.cancel()
        self._timer = asyncio.get_running_loop().call_later(LINGER_S, transport.abort)

    def close(self) -> None:
        """Close once everything is sent; requests that wait are dropped."""
        self.channel.close()
        if self._transport is not None:
            self._transport.close()
        self._frames.put_nowait(None)

    async def wait_closed(self) -> None:
        """Wait until the task of the connection has ended."""
        if self._task is not None:
            with contextlib.suppress(asyncio.CancelledError):
                await self._task
