"""Client of one Modbus device: blocks of registers in and out, over whatever transport it is given."""

from impactcell.fieldbus.codec import write_request
from impactcell.fieldbus.registers import Words
from impactcell.fieldbus.request_batching import Exchange, PartialBlock, RequestBatch
from impactcell.fieldbus.transports.protocol import Transport


class ModbusClient:
    """One device; `connect` may be called again after the connection was lost.

    A block is cut into requests of at most `link.max_registers`; how many of them are in flight is the
    transport's to know.
    """

    def __init__(self, transport: Transport) -> None:
        self.link = transport.link
        self._transport = transport

    @property
    def connected(self) -> bool:
        """Whether requests can be sent."""
        return self._transport.connected

    @property
    def round_trip_s(self) -> float:
        """Time between the last request and its reply; nan before the first."""
        return self._transport.round_trip_s

    async def connect(self) -> None:
        """Open the connection, unless it is open; raises LinkError if it cannot be made in time."""
        await self._transport.connect()

    async def close(self) -> None:
        """Close the connection and wait until it is gone; all that is pending fails."""
        await self._transport.close()

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
        exchange = Exchange()
        batches = [] if write is None else [RequestBatch(exchange, None, 0, (write_request(*write),))]
        for block in blocks:
            batches += block.batches(exchange)
        if batches:
            self._transport.submit(batches)
            await exchange.done

    async def write(self, address: int, words: Words) -> None:
        """Write holding registers in one request, before any read that waits; raises as `read` does."""
        exchange = Exchange()
        request = write_request(address, words)
        self._transport.submit([RequestBatch(exchange, None, 0, (request,))], first=True)
        await exchange.done
