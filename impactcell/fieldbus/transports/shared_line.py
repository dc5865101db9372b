"""One connection, or serial line, for one device or several: one request at a time, everyone in turn.

A gateway, and a line, can do one thing at a time anyway. Each device that waits has one request sent before
any other has its next one, so that all get the same share however much one of them asks for.
"""

import asyncio
import contextlib
from collections import deque
from collections.abc import Callable, Sequence
from typing import Final, Protocol

from impactcell.errors import (
    ConnectionLostError,
    FieldbusError,
    LinkError,
    ModbusExceptionError,
    ProtocolError,
)
from impactcell.fieldbus.codec import BUSY, Request
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.request_batching import RequestBatch, join_queue
from impactcell.fieldbus.transports.request_window import RequestWindow

_BUSY_PAUSE_S: Final = 0.02
"""How long a device that said busy is left alone; it is asked again until the timeout has passed."""


class LineClient(Protocol):
    """What a line is asked through; see `CheckedPymodbus`."""

    @property
    def connected(self) -> bool:
        """Whether requests can be sent."""

    async def connect(self) -> None:
        """Open the connection."""

    async def close(self) -> None:
        """Close the connection."""

    async def exchange(self, device_id: int, request: Request) -> bytes:
        """Send a request and return the data of its reply."""


class SharedLine:
    """Serves its members in turn, as long as any of them is connected.

    Parameters
    ----------
    client : callable
        Makes the client; it is given what to call when the connection is lost while nothing is asked.
    """

    def __init__(self, client: Callable[[Callable[[], None]], LineClient]) -> None:
        self._client = client(self._lost)
        self._turn: deque[LineTransport] = deque()
        self._wake = asyncio.Event()
        self._opening = asyncio.Lock()
        self._worker: asyncio.Task[None] | None = None

    def transport(self, link: ModuleLink) -> "LineTransport":
        """Make the transport of one device."""
        return LineTransport(link, self)

    async def join(self, member: "LineTransport") -> None:
        """Open the line unless it is open, and serve `member`."""
        await self._open()
        if member not in self._turn:
            self._turn.append(member)
        if self._worker is None:
            self._worker = asyncio.create_task(self._serve(), name=f"line of {member.link}")

    async def leave(self, member: "LineTransport") -> None:
        """Serve `member` no more; the last one closes the line."""
        if member in self._turn:
            self._turn.remove(member)
        if self._turn:
            return
        worker, self._worker = self._worker, None
        if worker is not None:
            worker.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await worker
        if not self._turn:  # nobody has come meanwhile
            await self._client.close()

    def wake(self) -> None:
        """Say that there is something to send."""
        self._wake.set()

    async def _open(self) -> None:
        async with self._opening:
            if not self._client.connected:
                await self._client.connect()

    def _lost(self) -> None:
        """Tell everyone that the peer has closed the connection."""
        for member in list(self._turn):
            self._drop(member, ConnectionLostError(f"{member.link}: connection lost"))

    def _drop(self, member: "LineTransport", why: LinkError) -> None:
        if member in self._turn:
            self._turn.remove(member)
        member.fail(why)

    async def _serve(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            self._wake.clear()
            now = loop.time()
            ready = next((each for each in self._turn if each.ready_s() <= now), None)
            if ready is not None:
                self._turn.remove(ready)
                self._turn.append(ready)
                await self._ask(ready)
                continue
            rest_s = min((each.ready_s() for each in self._turn), default=float("inf")) - now
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(None if rest_s == float("inf") else rest_s):
                    await self._wake.wait()

    async def _ask(self, member: "LineTransport") -> None:
        """Send the next request of a member; what becomes of it concerns nobody else."""
        try:
            await self._open()
        except FieldbusError as error:
            for each in list(self._turn):
                self._drop(each, LinkError(f"{each.link}: {error}"))
            return
        batch = member.next_request()
        if batch is None:
            return
        sent_s = asyncio.get_running_loop().time()
        try:
            data = await self._client.exchange(member.link.device_id, batch.requests[0])
        except ModbusExceptionError as exception:
            member.refused(batch, exception, sent_s)
        except (LinkError, ProtocolError) as error:
            await self._client.close()
            if member in self._turn:
                self._turn.remove(member)
            member.fail(type(error)(f"{member.link}: {error}"), batch)
        else:
            member.answered(batch, data, sent_s)


class LineTransport:
    """A `Transport` to one device on a line, where one request is in flight, whatever the settings say."""

    def __init__(self, link: ModuleLink, line: SharedLine) -> None:
        self.link = link
        self.window = RequestWindow(1, "as everywhere but over TCP to a device of its own")
        self.round_trip_s = float("nan")
        self._line = line
        self._connected = False
        self._waiting: deque[RequestBatch] = deque()
        self._rests_until_s = 0.0

    @property
    def connected(self) -> bool:
        """Whether requests can be sent."""
        return self._connected

    async def connect(self) -> None:
        """Open the line, unless it is open; raises LinkError if it cannot be opened in time."""
        if self._connected:
            return
        try:
            await self._line.join(self)
        except (LinkError, ProtocolError) as error:
            raise type(error)(f"{self.link}: {error}") from error
        self._connected = True

    async def close(self) -> None:
        """Leave the line; all that is pending fails."""
        self.fail(LinkError(f"{self.link}: connection closed"))
        await self._line.leave(self)

    def submit(self, batches: Sequence[RequestBatch], *, first: bool = False) -> None:
        """Send requests in order, `first` before all that waits; raises LinkError without a connection."""
        if not self._connected:
            raise LinkError(f"{self.link}: not connected")
        join_queue(self._waiting, batches, first=first)
        self._line.wake()

    def fail(self, error: FieldbusError, batch: RequestBatch | None = None) -> None:
        """Fail all that is pending, and `batch`, which was sent."""
        self._connected = False
        pending = [*([] if batch is None else [batch]), *self._waiting]
        self._waiting.clear()
        for each in pending:
            each.exchange.fail(error)

    def ready_s(self) -> float:
        """Give the time from which on there is something to send; infinite where nothing waits."""
        while self._waiting and self._waiting[0].exchange.done.done():  # failed, or nobody waits any more
            self._waiting.popleft()
        return self._rests_until_s if self._waiting else float("inf")

    def next_request(self) -> RequestBatch | None:
        """Take the next request out of what waits."""
        if self.ready_s() == float("inf"):
            return None
        batch = self._waiting[0]
        return batch.split(1) if len(batch.requests) > 1 else self._waiting.popleft()

    def answered(self, batch: RequestBatch, data: bytes, sent_s: float) -> None:
        """Put in the data of a good reply."""
        now, exchange = asyncio.get_running_loop().time(), batch.exchange
        self._rests_until_s = now + self.link.pause_s
        if exchange.done.done():  # it has ended, and what came until then may be in use
            return
        if batch.block is not None:
            batch.block.fill(batch.first, 1, data)
        exchange.unanswered -= 1
        if not exchange.unanswered:
            self.round_trip_s = now - sent_s
            exchange.done.set_result(None)

    def refused(self, batch: RequestBatch, exception: ModbusExceptionError, sent_s: float) -> None:
        """Ask a busy device again; else end the exchange."""
        now = asyncio.get_running_loop().time()
        self._rests_until_s = now + self.link.pause_s
        first_sent_s = batch.exchange.first_sent_s.setdefault(batch.requests[0], sent_s)
        if exception.code == BUSY and now + _BUSY_PAUSE_S < first_sent_s + self.link.timeout_s:
            self._rests_until_s = now + max(_BUSY_PAUSE_S, self.link.pause_s)
            if self._connected:
                self._waiting.appendleft(batch)
            return
        batch.exchange.fail(ModbusExceptionError(f"{self.link}: {exception}", exception.code))
