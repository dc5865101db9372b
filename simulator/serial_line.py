"""A simulated serial line: a pair of pseudo terminals, with the time that a real line's characters take.

A pseudo terminal hands bytes over at once. So the line waits for as long as the request took to arrive and
the silence behind it, and lets the bytes of the reply out one after another, by the pace that it is given.
"""

import asyncio
import contextlib
import os
import tty
from collections import deque
from collections.abc import Callable
from typing import Any, Final, Self

from simulator.answers import RegisterDevice
from simulator.client_connection import ClientConnection
from simulator.faults import FaultInjector
from simulator.modbus_server import ModbusServer
from simulator.rtu import RtuConnection

_AT_ONCE: Final = 16
"""Bytes that come out together, as out of the FIFO of a UART."""
_SILENCE: Final = 3.5
"""Characters of silence that end a frame."""
_BITS: Final = 11
"""Of a character: start bit, eight data bits, parity and stop bit."""

Pace = Callable[[int], float]
"""Seconds that so many characters take."""


def pace_of(baudrate: int) -> Pace:
    """Give the pace of a line.

    >>> round(pace_of(115_200)(256), 5)
    0.02444
    """
    return lambda characters: characters * _BITS / baudrate


def no_time(_: int) -> float:
    """Give the pace of a line that takes no time."""
    return 0.0


class PtyTransport(asyncio.Transport):
    """The module's end of the line."""

    def __init__(self, protocol: ClientConnection, pace: Pace) -> None:
        super().__init__()
        self._loop = asyncio.get_running_loop()
        self._pace = pace
        self._master, self._slave = os.openpty()  # the other end stays open, or the line would break
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.name = os.ttyname(self._slave)
        self._protocol = protocol
        self._out: deque[bytes] = deque()
        self._free_s = 0.0
        self._timer: asyncio.TimerHandle | None = None
        self._loop.add_reader(self._master, self._receive)
        protocol.connection_made(self)

    def _receive(self) -> None:
        with contextlib.suppress(BlockingIOError):
            data = os.read(self._master, 4096)
            arrived_s = max(self._free_s, self._loop.time()) + self._pace(len(data))
            self._free_s = arrived_s
            self._protocol.data_received(data)

    def write(self, data: "bytes | bytearray | memoryview[Any]") -> None:
        """Send, after the silence behind what came before."""
        if not self._out:
            silence_s = _SILENCE * self._pace(1)
            self._free_s = max(self._free_s, self._loop.time()) + silence_s
        self._out.extend(bytes(data[at : at + _AT_ONCE]) for at in range(0, len(data), _AT_ONCE))
        self._go_on()

    def _go_on(self) -> None:
        """Let out what its time has come for."""
        while self._out and self._timer is None:
            end_s = self._free_s + self._pace(len(self._out[0]))
            if end_s > self._loop.time():
                self._timer = self._loop.call_at(end_s, self._due)
                return
            self._let_out(end_s)

    def _due(self) -> None:
        self._timer = None
        if not self._out:
            return
        self._let_out(self._free_s + self._pace(len(self._out[0])))
        self._go_on()

    def _let_out(self, end_s: float) -> None:
        self._free_s = end_s
        with contextlib.suppress(BlockingIOError):  # nobody reads at the other end
            os.write(self._master, self._out.popleft())

    def abort(self) -> None:
        """Say no more of what was begun: a line has no connection that could be reset."""
        self._out.clear()

    def take_away(self) -> None:
        """Take the line away, as one pulls a converter out."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._out.clear()
        if self._master >= 0:
            self._loop.remove_reader(self._master)
            os.close(self._master)
            os.close(self._slave)
            self._master = -1
            self._loop.call_soon(self._protocol.connection_lost, None)


class SerialServer(ModbusServer):
    """Serves devices on a simulated line; `device_file` is what a client opens.

    A device that there is not says nothing.
    """

    is_line = True

    def __init__(
        self,
        device: RegisterDevice,
        device_id: int = 1,
        *,
        faults: FaultInjector | None = None,
        before: Callable[[], None] | None = None,
        pace: Pace = no_time,
    ) -> None:
        super().__init__(device, device_id, faults=faults, before=before)
        self.device_file = ""
        self._pace = pace
        self._line: PtyTransport | None = None

    async def start(self) -> None:
        """Open the line."""
        self._line = PtyTransport(RtuConnection(self), self._pace)
        self.device_file = self._line.name

    async def close(self) -> None:
        """Take the line away."""
        line, self._line = self._line, None
        if line is not None:
            line.take_away()
        await asyncio.gather(*(link.gone.wait() for link in self.links))

    def no_such_device(self, function: int) -> bytes | None:  # noqa: ARG002 - of a gateway
        """Return nothing: on a line nobody answers for another."""
        return None

    async def __aenter__(self) -> Self:
        """Open."""
        await self.start()
        return self
