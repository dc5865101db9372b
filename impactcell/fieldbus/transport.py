"""Modbus TCP client of one device: blocks of registers in and out, over one connection after another."""

import asyncio
import contextlib

from impactcell.errors import LinkError
from impactcell.fieldbus.codec import write_request
from impactcell.fieldbus.connection import Connection
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.registers import Words
from impactcell.fieldbus.request_batching import Exchange, PartialBlock, RequestBatch
from impactcell.fieldbus.transactions import TransactionIds


class ModbusClient:
    """One device; `connect` may be called again after the connection was lost.

    A block is cut into requests of at most `link.max_registers`, of which up to `link.window` are in flight.
    Every attempt has a fresh transaction id, also across connections.
    """

    def __init__(self, link: ModuleLink) -> None:
        self.link = link
        self._connection: Connection | None = None
        self._transactions = TransactionIds()

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
        except ConnectionRefusedError as error:
            raise LinkError(
                f"{link}: no connection: nothing listens there; is the module on, are host and port right?"
            ) from error
        except OSError as error:
            raise LinkError(f"{link}: no connection: {error.strerror or error}") from error

    async def close(self) -> None:
        """Close the connection and wait until it is gone; all that is pending fails."""
        connection, self._connection = self._connection, None
        if connection is None:
            return
        connection.fail(LinkError(f"{self.link}: connection closed"))
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

    async def complete(self, *blocks: PartialBlock, write: tuple[int, Words] | None = None) -> None:
        """Read what `blocks` still lack; after an error they keep what did arrive. Raises as `read` does.

        Parameters
        ----------
        *blocks : PartialBlock
            What is read, in this order.
        write : tuple of int and array, optional
            Address and words of holding registers that are written right before, in one request.
        """
        exchange, unit = Exchange(), self.link.device_id
        batches = [] if write is None else [RequestBatch(exchange, None, 0, (write_request(*write, unit),))]
        for block in blocks:
            batches += block.batches(exchange, unit)
        if batches:
            self._open().submit(batches)
            await exchange.done

    async def write(self, address: int, words: Words) -> None:
        """Write holding registers in one request, before any read that waits; raises as `read` does."""
        exchange = Exchange()
        request = write_request(address, words, self.link.device_id)
        self._open().submit([RequestBatch(exchange, None, 0, (request,))], first=True)
        await exchange.done

    def _open(self) -> Connection:
        if self._connection is None:
            raise LinkError(f"{self.link}: not connected")
        return self._connection
