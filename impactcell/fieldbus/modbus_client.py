"""Client of one Modbus device: blocks of registers in and out, over whatever transport it is given."""

from typing import Final

from impactcell.errors import LinkError, ModbusExceptionError, ProtocolError
from impactcell.fieldbus.codec import Request, mask_write_request, read_write_request, write_request
from impactcell.fieldbus.device_identification import OBJECTS, identification_objects, identification_request
from impactcell.fieldbus.register_map.register_types import BIT_TABLES
from impactcell.fieldbus.registers import Words
from impactcell.fieldbus.request_batching import Exchange, PartialBlock, ReplyData, RequestBatch
from impactcell.fieldbus.transports.protocol import Transport
from impactcell.fieldbus.transports.request_window import TRIAL_SIZES, RequestWindow

_MOST_PARTS: Final = 8
"""So many replies a device identification has at most: more would be a device that never ends."""
_BITS_A_REGISTER: Final = 16
"""Coils or discrete inputs that take the room of a register in a reply."""


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
    def window(self) -> RequestWindow:
        """How many requests may be in flight."""
        return self._transport.window

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

    async def find_window(self, address: int, count: int, table: str = "holding") -> bool:
        """Try, unless the settings say it, how many requests the device can have in flight.

        Parameters
        ----------
        address, count, table
            Registers that may be read; what they hold is of no interest.

        Returns
        -------
        bool
            Whether the connection is still good; if not, the next one begins without a trial.
        """
        window = self.window
        if not window.untried:
            return True
        longest = min(count, self.link.max_registers)
        for size in TRIAL_SIZES:
            if size > min(longest, window.most):
                break
            window.size = size
            blocks = [PartialBlock(address, longest - shorter, table, longest) for shorter in range(size)]
            exchange = Exchange()
            self._transport.submit([batch for block in blocks for batch in block.batches(exchange)])
            try:
                await exchange.done
            except ModbusExceptionError as error:
                window.leave_undecided(str(error))
                return True
            except (LinkError, ProtocolError):
                return False
            if exchange.first_sent_s:
                window.leave_undecided(f"{self.link}: busy where {size} requests are in flight")
            if window.size < size:
                return True
        window.accept_trials()
        return True

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

    def block(self, address: int, count: int, table: str = "holding", fewer: int = 0) -> PartialBlock:
        """Give a block of registers that is still to be read, by `complete`.

        A request reads as many of them as the link allows, or `fewer`.
        """
        registers = max(self.link.max_registers - fewer, 1)
        step = registers * (_BITS_A_REGISTER if table in BIT_TABLES else 1)
        return PartialBlock(address, count, table, step)

    async def complete(
        self, *blocks: PartialBlock, write: tuple[int, Words] | None = None, at_once: bool = False
    ) -> None:
        """Read what `blocks` still lack; after an error they keep what did arrive. Raises as `read` does.

        Parameters
        ----------
        *blocks : PartialBlock
            What is read, in this order.
        write : tuple of int and array, optional
            Address and words of holding registers that are written right before, in one request.
        at_once : bool
            Whether the device can write and read in one request (function 23): then the first of the first
            block, which is of holding registers, is read in the request that writes.
        """
        exchange = Exchange()
        batches = [batch for block in blocks for batch in block.batches(exchange)]
        if write is not None and at_once and batches:
            first = batches[0] if len(batches[0].requests) == 1 else batches[0].split(1)
            batches = [first, *(batch for batch in batches if batch is not first)]
            begin = blocks[0].step * first.first
            count = min(blocks[0].step, blocks[0].count - begin)
            first.requests = (read_write_request(blocks[0].address + begin, count, *write),)
        elif write is not None:
            batches.insert(0, RequestBatch(exchange, None, 0, (write_request(*write),)))
        if batches:
            self._transport.submit(batches)
            await exchange.done

    async def write(self, address: int, words: Words, table: str = "holding") -> None:
        """Write holding registers or coils in one request, before any read that waits; raises as `read`."""
        await self._ask(write_request(address, words, table), None)

    async def write_bits(self, address: int, keep: int, put: int) -> None:
        """Change bits of a holding register (function 22), before any read that waits; raises as `read`.

        Those that `keep` has stay as they are, the others become those of `put`.
        """
        await self._ask(mask_write_request(address, keep, put), None)

    async def identification(self) -> dict[str, str]:
        """Ask the device who made it and what it is (function 43/14), by `OBJECTS`; raises as `read` does."""
        texts: dict[int, str] = {}
        following: int | None = 0
        for _ in range(_MOST_PARTS):
            if following is None:
                break
            reply = ReplyData()
            await self._ask(identification_request(following), reply)
            objects, following = identification_objects(reply.data)
            texts |= objects
        return {OBJECTS[number]: text for number, text in sorted(texts.items()) if number in OBJECTS and text}

    async def _ask(self, request: Request, reply: ReplyData | None) -> None:
        exchange = Exchange()
        self._transport.submit([RequestBatch(exchange, reply, 0, (request,))], first=True)
        await exchange.done
