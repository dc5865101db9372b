"""A client of pymodbus, one request at a time, of which nothing unchecked is ever used.

pymodbus connects, sends, receives and frames; this sees every byte before it does (`ReplyWatch`), tells at
once that a connection is lost, and leaves no request behind that a late reply could be taken for:

- no retries, for they would reuse the transaction; no reconnecting behind our back;
- transactions go on over connections, from a random one on;
- RTU has no transactions. A reply counts once the line was silent after it, and after a request that was not
  answered well the line is opened anew and listened to, until nothing has come for as long as an answer may
  take. A reply that comes later still cannot be told from the answer to the next request alike; the checksums
  of the map are what is left then.
"""

import asyncio
import contextlib
import logging
import random
from collections.abc import Callable
from typing import Any, Final

from pymodbus.client import (
    AsyncModbusSerialClient,
    AsyncModbusTcpClient,
    AsyncModbusTlsClient,
    AsyncModbusUdpClient,
)
from pymodbus.client.base import ModbusBaseClient
from pymodbus.exceptions import ModbusException
from pymodbus.framer import FramerType
from pymodbus.pdu import ModbusPDU

from impactcell.errors import (
    ConnectionLostError,
    FieldbusError,
    LinkError,
    ModbusExceptionError,
    NoAnswerError,
    ProtocolError,
)
from impactcell.fieldbus.codec import Request
from impactcell.fieldbus.link import NO_NAME, ModuleLink
from impactcell.fieldbus.transports.reply_watch import MbapWatch, ReplyWatch, RtuWatch

_NEVER_S: Final = 3600.0
"""pymodbus's own timeout of a reply, s: ours comes before it."""
_LAST_TRANSACTION: Final = 64_000
"""pymodbus begins anew with 1 after 65 000."""
_MOST_LISTENING: Final = 8
"""So many times the timeout a line is listened to that does not become silent."""

_PORT_REFUSES: tuple[type[Exception], ...] = (ValueError,)
"""What pyserial lets through that is no OSError: a port that has no such parity or speed."""
with contextlib.suppress(ImportError):  # not on Windows
    import termios

    _PORT_REFUSES = (ValueError, termios.error)

logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)  # what it says there is raised here


class _RawRequest(ModbusPDU):
    """A request that is encoded already."""

    def __init__(self, pdu: bytes, device_id: int) -> None:
        super().__init__(dev_id=device_id)
        self.function_code = pdu[0]
        self._data = pdu[1:]

    def encode(self) -> bytes:
        """Give the data as it stands."""
        return self._data


class CheckedPymodbus:
    """One connection after another to one endpoint, for whichever device is behind it.

    Parameters
    ----------
    link : ModuleLink
        Its `device_id` is not used.
    on_lost : callable
        Called when the connection is lost while nothing is asked.
    """

    def __init__(self, link: ModuleLink, on_lost: Callable[[], None]) -> None:
        self._link = link
        self._on_lost = on_lost
        self._rtu = link.transport in ("rtu", "rtu_over_tcp")
        self._client: ModbusBaseClient | None = None
        self._watch: ReplyWatch | None = None
        self._reply: bytes | ModbusExceptionError | None = None
        self._heard = self._in_step = True
        self._transaction = random.randrange(_LAST_TRANSACTION)  # noqa: S311 - to differ, not to be secret
        self._why: OSError | None = None

    @property
    def connected(self) -> bool:
        """Whether requests can be sent."""
        return self._client is not None and self._client.connected

    async def connect(self) -> None:
        """Open the connection; raises LinkError if it cannot be made within the timeout."""
        link = self._link
        self._client = client = self._made()
        self._why = None
        try:
            async with asyncio.timeout(link.timeout_s):
                connected = await client.connect()
        except TimeoutError:
            connected = False
        except FieldbusError:
            self._client = None
            raise
        if not connected:
            await self.close()
            raise LinkError(self._unreachable()) from self._why
        await asyncio.sleep(0)  # a serial port begins to be read in the next step of the loop
        if self._rtu and not self._in_step:
            await self._listen()
        self._in_step, self._heard = True, False

    async def close(self) -> None:
        """Close the connection."""
        client, self._client = self._client, None
        if client is None:
            return
        transport = client.ctx.transport
        if isinstance(transport, asyncio.Transport | asyncio.DatagramTransport):
            transport.abort()
        client.close()
        for _ in range(2):  # until the loop has closed the socket
            await asyncio.sleep(0)

    async def exchange(self, device_id: int, request: Request) -> bytes:
        """Send a request and return the data of the reply.

        Raises
        ------
        LinkError, ProtocolError
            No answer, no good one, or the connection is lost; it has to be closed then.
        ModbusExceptionError
            The device refuses.
        """
        client, link = self._client, self._link
        if client is None or not client.connected:
            raise LinkError("not connected")
        if self._heard:
            raise ProtocolError("more bytes than were asked for")
        client.ctx.next_tid = self._transaction % _LAST_TRANSACTION
        self._transaction = client.ctx.next_tid + 1  # as pymodbus counts
        if self._rtu:
            self._watch = RtuWatch(device_id, request)
        else:
            datagram = link.transport == "udp"
            self._watch = MbapWatch(self._transaction, device_id, request, datagram=datagram)
        self._reply, self._in_step = None, False
        timeout_s = link.timeout_s + self._on_line_s(len(request.pdu) + request.longest_reply)
        try:
            async with asyncio.timeout(timeout_s):
                await client.execute(False, _RawRequest(request.pdu, device_id))  # noqa: FBT003 - pymodbus's
        except TimeoutError:
            raise NoAnswerError(f"no answer to {request.description} within {link.patience}") from None
        except ModbusException as error:
            raise ProtocolError(f"{request.description}: {error}") from error
        finally:
            self._watch = None
        if link.serial is not None:
            await asyncio.sleep(link.serial.silence_s)
        if self._heard:
            raise ProtocolError("more bytes than were asked for")
        if self._reply is None:
            raise ProtocolError(f"{request.description}: no answer in what came")
        self._in_step = True
        if isinstance(self._reply, ModbusExceptionError):
            raise self._reply
        return self._reply

    def _on_line_s(self, count: int) -> float:
        """Time that so many bytes of PDU, in frames, take on the line."""
        serial = self._link.serial
        return 0.0 if serial is None else (count + 6) * serial.character_s + 2.0 * serial.silence_s

    def _made(self) -> ModbusBaseClient:
        link = self._link
        common: dict[str, Any] = {
            "reconnect_delay": 0, "retries": 0, "timeout": _NEVER_S,
            "trace_packet": self._packet, "trace_connect": self._connection_changed,
        }  # fmt: skip
        client: ModbusBaseClient
        if link.serial is not None:
            serial = link.serial
            return self._telling_why(
                AsyncModbusSerialClient(
                    serial.device, baudrate=serial.baudrate, parity=serial.parity,
                    stopbits=serial.stop_bits, bytesize=serial.data_bits, **common,
                )
            )  # fmt: skip
        if link.transport == "udp":
            client = AsyncModbusUdpClient(link.host, port=link.port, **common)
        elif link.tls is not None:
            context = link.tls.context()
            client = AsyncModbusTlsClient(link.host, port=link.port, sslctx=context, **common)
            name = link.tls.server_name or link.host
            return self._telling_why(client, server_hostname=name)
        else:
            framer = FramerType.RTU if self._rtu else FramerType.SOCKET
            client = AsyncModbusTcpClient(link.host, port=link.port, framer=framer, **common)
        return self._telling_why(client)

    def _telling_why(self, client: ModbusBaseClient, **arguments: str) -> ModbusBaseClient:
        """Keep the reason why a connection cannot be made, which pymodbus only logs."""
        create = client.ctx.call_create

        async def creating() -> object:
            try:
                return await create(**arguments)
            except OSError as error:
                self._why = error
                raise
            except UnicodeError as error:
                self._why = OSError(NO_NAME)
                raise self._why from error
            except _PORT_REFUSES as error:
                refuses = "" if self._link.serial is None else "the serial port refuses its settings: "
                self._why = OSError(f"{refuses}{error.args[-1]}")
                raise self._why from error

        client.ctx.call_create = creating
        return client

    def _unreachable(self) -> str:
        match self._why:
            case None:
                return f"no connection within {self._link.patience}"
            case ConnectionRefusedError():
                return "no connection: nothing listens at this host and port"
            case error:
                return f"no connection: {error.strerror or error}"

    def _packet(self, sending: bool, data: bytes) -> bytes:  # noqa: FBT001 - pymodbus's signature
        """See every packet before pymodbus does; it gets only the whole of a good reply."""
        if sending:
            return data
        self._heard = True
        future = None if self._client is None else self._client.ctx.response_future
        if self._watch is None or future is None or future.done():
            return b""
        try:
            self._reply = self._watch.take(data)
        except ModbusExceptionError as refusal:
            self._reply = refusal
        except ProtocolError as error:
            future.set_exception(error)
            return b""
        self._heard = False
        return b"" if self._reply is None else data

    def _connection_changed(self, connected: bool) -> None:  # noqa: FBT001 - pymodbus's signature
        """Fail what waits as soon as the connection is lost."""
        if connected or self._client is None:
            return
        future = self._client.ctx.response_future
        if self._watch is not None and not future.done():
            future.set_exception(ConnectionLostError("connection lost"))
        else:
            self._on_lost()

    async def _listen(self) -> None:
        """Wait until nothing has come for as long as an answer may take, so that none is still on its way."""
        for _ in range(_MOST_LISTENING):
            self._heard = False
            await asyncio.sleep(self._link.timeout_s)
            if not self._heard:
                return
        raise ProtocolError("the line does not become silent; does another master speak on it?")
