"""A Modbus TCP server for a simulated device, and, on demand, a peer that breaks every rule.

Functions 1 to 6, 15, 16, 22, 23 and 43/14 (see `answers`); all others are refused with exception 1. Pipelined
requests are answered in order, several clients are served. The device is a plain object that knows nothing of
sockets.
"""

import asyncio
import enum
import ssl
import struct
from collections.abc import Callable
from types import TracebackType
from typing import Self

from simulator.answers import RegisterDevice, answer
from simulator.client_connection import ClientConnection
from simulator.faults import FaultInjector


class ExceptionCode(enum.IntEnum):
    """Exception codes of the Modbus Application Protocol V1.1b3, section 7."""

    ILLEGAL_FUNCTION = 1
    ILLEGAL_ADDRESS = 2
    ILLEGAL_VALUE = 3
    DEVICE_BUSY = 6
    GATEWAY_NO_RESPONSE = 11


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

    Attributes
    ----------
    devices : dict
        Unit id to device; more than one make it a gateway.
    """

    is_line = False
    """Whether there is but one connection, for good."""
    connection: type[ClientConnection] = ClientConnection
    """What each client is served by."""

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
        self.links: list[ClientConnection] = []
        self.devices: dict[int, RegisterDevice] = {device_id: device}
        self._tls = tls
        self._server: asyncio.Server | None = None

    async def start(self) -> None:
        """Listen; `port` then is the port that was given by the system if it was 0."""
        loop = asyncio.get_running_loop()
        self._server = await loop.create_server(
            lambda: self.connection(self), self.host, self.port, ssl=self._tls
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

    def no_such_device(self, function: int) -> bytes | None:
        """Return the reply in the place of a device that there is not."""
        return bytes((function | 0x80, ExceptionCode.GATEWAY_NO_RESPONSE))

    def answer(self, unit: int, pdu: bytes) -> bytes | None:
        """Return the reply PDU to a request PDU; None for silence."""
        self.requests += 1
        function = pdu[0]
        device = self.devices.get(unit)
        if device is None:
            return self.no_such_device(function)
        try:
            return answer(device, function, pdu)
        except NotImplementedError:
            return bytes((function | 0x80, ExceptionCode.ILLEGAL_FUNCTION))
        except LookupError:
            return bytes((function | 0x80, ExceptionCode.ILLEGAL_ADDRESS))
        except BlockingIOError:
            return bytes((function | 0x80, ExceptionCode.DEVICE_BUSY))
        except (ValueError, IndexError, struct.error):
            return bytes((function | 0x80, ExceptionCode.ILLEGAL_VALUE))
