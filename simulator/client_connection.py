"""One client's connection to a simulated module: frames of Modbus TCP in, replies and their faults out."""

import asyncio
import contextlib
import random
import struct
from collections.abc import Callable
from typing import Final, Protocol

from simulator.faults import Fault, FaultInjector, FaultKind, corrupt

_HEADER: Final = struct.Struct(">HHHB")
_PIECE_S: Final = 0.002
"""How long a piece of a split frame, or a frame to be joined with the next, is held back."""


class Answering(Protocol):
    """What a connection needs of its server."""

    faults: FaultInjector
    before: Callable[[], None] | None
    links: list["ClientConnection"]

    def answer(self, unit: int, pdu: bytes) -> bytes | None:
        """Return the reply PDU to a request PDU; None for silence."""


class ClientConnection(asyncio.Protocol):
    """One client's connection."""

    def __init__(self, server: Answering) -> None:
        self.gone = asyncio.Event()
        self._server = server
        self._transport: asyncio.Transport | None = None
        self._buffer = b""
        self._joined = b""
        self._gate: list[bytes] | None = None
        self._mute = False
        self._loop = asyncio.get_running_loop()
        self._later: set[asyncio.TimerHandle] = set()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take over a fresh connection (called by asyncio)."""
        assert isinstance(transport, asyncio.Transport)  # noqa: S101 - TCP and TLS both give one
        self._transport = transport
        self._server.links.append(self)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's signature
        """Forget the client (called by asyncio)."""
        self._transport = None
        for handle in self._later:
            handle.cancel()
        with contextlib.suppress(ValueError):
            self._server.links.remove(self)
        self.gone.set()

    def abort(self) -> None:
        """Reset the connection."""
        if self._transport is not None:
            self._transport.abort()

    @property
    def _honest(self) -> bool:
        """Whether nothing befalls the replies."""
        return not (self._server.faults.active or self._mute or self._joined)

    def data_received(self, data: bytes) -> None:
        """Answer requests (called by asyncio)."""
        server = self._server
        if server.before is not None:
            server.before()
        buffer = self._buffer + data if self._buffer else data
        replies: list[bytes] = []
        at, size, honest = 0, len(buffer), self._honest
        unpack, pack, answer = _HEADER.unpack_from, _HEADER.pack, server.answer
        while size - at >= 7:
            transaction, protocol, length, unit = unpack(buffer, at)
            if protocol or not 2 <= length <= 254:
                self.abort()
                return
            if at + 6 + length > size:
                break
            end = at + 6 + length
            pdu = answer(unit, buffer[at + 7 : end])
            at = end
            if pdu is None:
                continue
            head = pack(transaction, 0, len(pdu) + 1, unit)
            if honest:
                replies += (head, pdu)
                continue
            self._reply(head + pdu, replies)
        self._buffer = buffer[at:]
        self._send(b"".join(replies))

    def _reply(self, reply: bytes, replies: list[bytes]) -> None:
        """Put a reply behind those that go out together, or let a fault befall it."""
        if self._mute:
            return
        faults = self._server.faults
        fault = faults.choose() if faults.active else None
        if fault is not None:
            self._send(b"".join(replies))
            replies.clear()
            self._misbehave(fault, reply)
        elif self._joined:
            replies.append(self._joined + reply)
            self._joined = b""
        else:
            replies.append(reply)

    def _send(self, data: bytes) -> None:
        if self._gate is not None:
            self._gate.append(data)
        elif data and self._transport is not None:
            self._transport.write(data)

    def _later_do(self, seconds: float, action: Callable[[], None]) -> None:
        def act() -> None:
            self._later.discard(handle)
            action()

        handle = self._loop.call_later(seconds, act)
        self._later.add(handle)

    def _misbehave(self, fault: Fault, reply: bytes) -> None:
        draw = self._server.faults.random
        match fault.kind:
            case FaultKind.DELAY:
                self._later_do(fault.seconds, lambda: self._send(reply))
            case FaultKind.JITTER:
                self._later_do(fault.seconds * draw.random(), lambda: self._send(reply))
            case FaultKind.DROP:
                pass
            case FaultKind.HALF_OPEN:
                self._mute = True
            case FaultKind.RESET:
                self._send(reply[: draw.randrange(1, len(reply))])
                self.abort()
            case FaultKind.LATE_REPLY:
                self._loop.call_later(fault.seconds, self._send_on_newest, reply)
            case FaultKind.DUPLICATE:
                self._send(reply + reply)
            case FaultKind.JOINED:
                self._joined += reply
                self._later_do(_PIECE_S, self._flush_joined)
            case FaultKind.SPLIT:
                at = draw.randrange(1, len(reply))
                self._send(reply[:at])
                if self._gate is None:
                    self._gate = [reply[at:]]
                    self._later_do(_PIECE_S, self._open_gate)
                else:
                    self._send(reply[at:])
            case _:
                self._send(self._corrupt(fault, reply, draw))

    def _corrupt(self, fault: Fault, reply: bytes, draw: random.Random) -> bytes:
        return corrupt(fault, reply, draw)

    def _send_on_newest(self, reply: bytes) -> None:
        """Send on whatever connection is newest, as a gateway does whose client has come back meanwhile."""
        links = self._server.links
        if links:
            links[-1]._send(reply)  # noqa: SLF001 - same class

    def _flush_joined(self) -> None:
        joined, self._joined = self._joined, b""
        self._send(joined)

    def _open_gate(self) -> None:
        buffer, self._gate = self._gate, None
        self._send(b"".join(buffer or ()))
