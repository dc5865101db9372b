"""Modbus TCP client of one device: blocks of registers in and out, over one connection after another."""

import asyncio
import contextlib
import itertools
import random
from collections.abc import Iterator
from functools import lru_cache
from typing import Final

import numpy as np

from impactcell.errors import LinkError
from impactcell.fieldbus.codec import Function, Request, read_request, write_request
from impactcell.fieldbus.connection import Connection, Exchange, Part
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.registers import WIRE, Words

_STRIDE: Final = 40_503
"""Odd, so that it visits all 16-bit numbers; 2^16 over the golden ratio, so that neighbours lie far apart."""
_READ_FUNCTION: Final = {"holding": Function.READ_HOLDING, "input": Function.READ_INPUT}


def _transactions() -> Iterator[bytes]:
    """Yield transaction ids: each of the 65 536 once before any comes again.

    They start anywhere, so that a gateway's late reply to an earlier client is not for one of ours, and lie
    far apart, so that a peer that is off by a little never hits another request in flight.
    """
    start = random.getrandbits(16)
    return (((start + number * _STRIDE) & 0xFFFF).to_bytes(2, "big") for number in itertools.count())


@lru_cache(maxsize=256)
def _requests(table: str, address: int, count: int, step: int, unit: int) -> tuple[tuple[int, Request], ...]:
    """Cut a block into requests, each with where in its bytes the reply goes."""
    function = _READ_FUNCTION[table]
    return tuple(
        (2 * first, read_request(function, address + first, min(step, count - first), unit))
        for first in range(0, count, step)
    )


class PartialBlock:
    """A block of registers, as far as it has been read.

    Attributes
    ----------
    data : bytearray
        The registers, big-endian; zero where they are missing.
    missing : set of int
        Where in `data` the requests go that have not been answered.
    """

    __slots__ = ("address", "count", "data", "missing", "step", "table")

    def __init__(self, address: int, count: int, table: str, step: int) -> None:
        self.address = address
        self.count = count
        self.table = table
        self.step = step
        self.data = bytearray(2 * count)
        self.missing = set(range(0, 2 * count, 2 * step))

    def words(self) -> Words:
        """Return the registers, shape (count,), dtype `WIRE`."""
        return np.frombuffer(self.data, dtype=WIRE)


class ModbusClient:
    """One device; `connect` may be called again after the connection was lost.

    A block is cut into requests of at most `link.max_registers`, of which up to `link.window` are in flight.
    Every attempt has a fresh transaction id, also across connections.
    """

    def __init__(self, link: ModuleLink) -> None:
        self.link = link
        self._connection: Connection | None = None
        self._transactions = _transactions()

    @property
    def connected(self) -> bool:
        """Whether requests can be sent."""
        return self._connection is not None and self._connection.open

    @property
    def round_trip_s(self) -> float:
        """Time between the last request and its reply; nan before the first."""
        return self._connection.round_trip_s if self._connection is not None else float("nan")

    async def connect(self) -> None:
        """Open the connection, unless it is open.

        Raises
        ------
        LinkError
            If it cannot be made within the timeout.
        """
        if self.connected:
            return
        link, loop = self.link, asyncio.get_running_loop()
        context = link.tls.context() if link.tls else None
        name = (link.tls.server_name or link.host) if link.tls else None
        try:
            async with asyncio.timeout(link.timeout_s):
                _, self._connection = await loop.create_connection(
                    lambda: Connection(link, self._transactions),
                    link.host,
                    link.port,
                    ssl=context,
                    server_hostname=name,
                )
        except TimeoutError:
            raise LinkError(f"{link}: no connection within {link.timeout_s:g} s") from None
        except OSError as error:
            raise LinkError(f"{link}: no connection: {error.strerror or error}") from error

    async def close(self) -> None:
        """Close the connection and wait until it is gone; all that is pending fails."""
        connection, self._connection = self._connection, None
        if connection is None:
            return
        connection.give_up(LinkError(f"{self.link}: connection closed"))
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(self.link.timeout_s):
                await connection.lost.wait()

    async def read(self, address: int, count: int, table: str = "holding") -> Words:
        """Read registers as they stand on the wire, shape (count,), dtype `WIRE`.

        Raises
        ------
        LinkError, ProtocolError
            If the connection is gone; it fails all that is pending at once.
        ModbusExceptionError
            If the device refuses; the connection stays.
        """
        block = self.block(address, count, table)
        await self.complete(block)
        return block.words()

    def block(self, address: int, count: int, table: str = "holding") -> PartialBlock:
        """Give a block of registers that is still to be read, by `complete`."""
        return PartialBlock(address, count, table, self.link.max_registers)

    async def complete(self, *blocks: PartialBlock) -> None:
        """Read what `blocks` still lack; after an error they keep what did arrive. Raises as `read` does."""
        exchanges: list[Exchange] = []
        parts: list[Part] = []
        for block in blocks:
            if missing := block.missing:
                exchange = Exchange(block.data, missing)
                requests = _requests(block.table, block.address, block.count, block.step, self.link.device_id)
                parts += [
                    Part(exchange, request, offset) for offset, request in requests if offset in missing
                ]
                exchanges.append(exchange)
        if len(exchanges) == 1:
            self._open().submit(parts)
            await exchanges[0].done
        elif exchanges:
            self._open().submit(parts)
            await asyncio.gather(*(exchange.done for exchange in exchanges))

    async def write(self, address: int, words: Words) -> None:
        """Write holding registers in one request, before any read that waits; raises as `read` does."""
        exchange = Exchange(bytearray(), {0})
        self._open().submit(
            [Part(exchange, write_request(address, words, self.link.device_id), 0)], first=True
        )
        await exchange.done

    def _open(self) -> Connection:
        if self._connection is None:
            raise LinkError(f"{self.link}: not connected")
        return self._connection
