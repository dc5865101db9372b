"""A Modbus TCP server for a simulated device, and, on demand, a peer that breaks every rule.

Functions 3, 4, 6 and 16; all others are refused with exception 1. Pipelined requests are answered in order,
several clients are served. The device is a plain object that knows nothing of sockets.
"""

import asyncio
import contextlib
import enum
import ssl
import struct
from collections.abc import Callable
from types import TracebackType
from typing import Final, Protocol, Self

import numpy as np

from impactcell.fieldbus.registers import WIRE, Words
from simulator.faults import Fault, FaultInjector, FaultKind, corrupt


class ExceptionCode(enum.IntEnum):
    """Exception codes of the Modbus Application Protocol V1.1b3, section 7."""

    ILLEGAL_FUNCTION = 1
    ILLEGAL_ADDRESS = 2
    ILLEGAL_VALUE = 3
    DEVICE_BUSY = 6
    GATEWAY_NO_RESPONSE = 11


_TABLES: Final = {3: "holding", 4: "input"}
"""Which table a reading function shows."""
_HEADER: Final = struct.Struct(">HHHB")
_READ: Final = struct.Struct(">BHH")
_TWO: Final = struct.Struct(">HH")
_HEADS: Final = {
    (function, count): bytes((function, 2 * count)) for function in _TABLES for count in range(1, 126)
}
"""What the reply to a read begins with."""
_PIECE_S: Final = 0.002
"""How long a piece of a split frame, or a frame to be joined with the next, is held back."""


class RegisterDevice(Protocol):
    """What the server needs of a device."""

    def read(self, table: str, address: int, count: int) -> Words:
        """Return `count` registers; LookupError where there is no such address, BlockingIOError if busy."""

    def write(self, address: int, words: Words) -> None:
        """Write holding registers; LookupError as above, ValueError for a value that is refused."""


class ModbusServer:
    """Serves one device; `async with ModbusServer(device) as server: server.port`.

    Parameters
    ----------
    device : RegisterDevice
        What is served.
    device_id : int
        Unit id that is answered; others get exception 11, as from a gateway.
    faults : FaultInjector, optional
        What befalls replies.
    before : callable, optional
        Called before requests are answered, to bring the device up to date.
    """

    def __init__(
        self,
        device: RegisterDevice,
        device_id: int = 1,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        faults: FaultInjector | None = None,
        before: Callable[[], None] | None = None,
        tls: ssl.SSLContext | None = None,
    ) -> None:
        self.device = device
        self.device_id = device_id
        self.host = host
        self.port = port
        self.faults = faults if faults is not None else FaultInjector()
        self.before = before
        self.requests = 0
        self.links: list[_ClientConnection] = []
        self._tls = tls
        self._server: asyncio.Server | None = None

    async def start(self) -> None:
        """Listen; `port` then is the port that was given by the system if it was 0."""
        loop = asyncio.get_running_loop()
        self._server = await loop.create_server(
            lambda: _ClientConnection(self), self.host, self.port, ssl=self._tls
        )
        self.port = self._server.sockets[0].getsockname()[1]

    async def close(self) -> None:
        """Stop listening and drop every client."""
        server, self._server = self._server, None
        if server is not None:
            server.close()
            self.drop_clients()
            await server.wait_closed()
        await asyncio.gather(*(link.gone.wait() for link in self.links))

    def drop_clients(self) -> None:
        """Reset every connection, as a module that loses power does."""
        for link in list(self.links):
            link.abort()

    async def __aenter__(self) -> Self:
        """Start."""
        await self.start()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        await self.close()

    def answer(self, unit: int, pdu: bytes) -> bytes:
        """Return the reply PDU to a request PDU."""
        self.requests += 1
        function = pdu[0]
        if unit != self.device_id:
            return bytes((function | 0x80, ExceptionCode.GATEWAY_NO_RESPONSE))
        try:
            return self._answer(function, pdu)
        except LookupError:
            return bytes((function | 0x80, ExceptionCode.ILLEGAL_ADDRESS))
        except BlockingIOError:
            return bytes((function | 0x80, ExceptionCode.DEVICE_BUSY))
        except (ValueError, struct.error):
            return bytes((function | 0x80, ExceptionCode.ILLEGAL_VALUE))

    def _answer(self, function: int, pdu: bytes) -> bytes:
        table = _TABLES.get(function)
        if table is not None:
            _, address, count = _READ.unpack(pdu)
            if not 1 <= count <= 125:
                raise ValueError(count)
            if address + count > 65_536:
                raise LookupError(address)
            words = self.device.read(table, address, count)
            if words.dtype is not WIRE:
                words = words.astype(WIRE, copy=False)
            return _HEADS[function, count] + words.tobytes()
        if function == 6:
            address, _ = _TWO.unpack(pdu[1:])
            self.device.write(address, np.frombuffer(pdu, dtype=WIRE, offset=3))
            return pdu
        if function == 16:
            address, count = _TWO.unpack_from(pdu, 1)
            if not 1 <= count <= 123 or len(pdu) != 6 + 2 * count or pdu[5] != 2 * count:
                raise ValueError(count)
            if address + count > 65_536:
                raise LookupError(address)
            self.device.write(address, np.frombuffer(pdu, dtype=WIRE, offset=6))
            return pdu[:5]
        return bytes((function | 0x80, ExceptionCode.ILLEGAL_FUNCTION))


class _ClientConnection(asyncio.Protocol):
    """One client's connection."""

    def __init__(self, server: ModbusServer) -> None:
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
        assert isinstance(transport, asyncio.Transport)  # noqa: S101 - TCP and TLS both give one
        self._transport = transport
        self._server.links.append(self)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002 - asyncio's signature
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
            head = pack(transaction, 0, len(pdu) + 1, unit)
            if honest:
                replies += (head, pdu)
                continue
            reply = head + pdu
            if self._mute:
                continue
            fault = server.faults.choose() if server.faults.active else None
            if fault is not None:
                self._send(b"".join(replies))
                replies.clear()
                self._misbehave(fault, reply)
            elif self._joined:
                replies.append(self._joined + reply)
                self._joined = b""
            else:
                replies.append(reply)
        self._buffer = buffer[at:]
        self._send(b"".join(replies))

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
                self._send(corrupt(fault, reply, draw))

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
