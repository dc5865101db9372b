"""Registers by name, over a client: neighbouring registers are read in as few requests as may be."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from impactcell.errors import ModbusExceptionError, ProtocolError
from impactcell.fieldbus.codec import MAX_WRITE
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.register_image import RegisterBlock, RegisterImage, decoded_image, group_registers
from impactcell.fieldbus.register_map.map_validation import READ_WRITE
from impactcell.fieldbus.registers import Register, RegisterMap, Words
from impactcell.fieldbus.request_batching import PartialBlock

_STABLE_READ_ATTEMPTS: Final = 8
"""Readings of a block of several requests until two agree, before it counts as restless."""


_ILLEGAL_ADDRESS: Final = 2
"""Exception code of a request for what the module does not have."""


class RegisterClient:
    """A device whose registers have names."""

    def __init__(self, modbus: ModbusClient, registers: RegisterMap) -> None:
        self.modbus = modbus
        self.registers = registers
        self._header = tuple(register.name for register in registers.header())
        self._groups: dict[tuple[str, ...], tuple[RegisterBlock, ...]] = {}
        self._images: dict[tuple[str, ...], RegisterImage] = {}

    async def find_window(self) -> bool:
        """Try how many requests the device can have in flight, by its samples; see `ModbusClient`."""
        arrays = [self.registers[name] for name in self.registers.arrays]
        if not arrays:
            return True
        most = max(arrays, key=lambda register: register.end - register.address)
        return await self.modbus.find_window(most.address, most.end - most.address, most.table)

    async def read_image(self, names: tuple[str, ...]) -> RegisterImage:
        """Read registers; those that the map does not have are left out.

        What shows the same words as before comes back as the very same image.
        """
        blocks = self._blocks(names)
        raw = [words.tobytes() for words in await self._read(blocks)]
        for i, block in enumerate(blocks):
            if block.count > self.modbus.link.max_registers:
                raw[i] = await self._read_until_stable(block, raw[i])
        image = self._images.get(names)
        if image is None or image.raw != tuple(raw):  # nearly always a poll finds all unchanged
            image = self._images[names] = decoded_image(blocks, raw, image)
        return image

    def partial_block(self, name: str, values: int, *, again: bool = False) -> PartialBlock:
        """Give the first `values` values of a register as a block that is still to be read.

        `again`: cut into other requests than else, so that a reply that is for the request before does not
        agree with itself.
        """
        register = self.registers[name]
        words = values * register.words_per_value
        return self.modbus.block(register.address, words, register.table, fewer=int(again))

    async def read_words(self, name: str, values: int) -> Words:
        """Read the words of the first `values` values of a register."""
        partial_block = self.partial_block(name, values)
        await self.modbus.complete(partial_block)
        return partial_block.words()

    async def read_header(self, slot: int | None = None) -> RegisterImage:
        """Read what stands beside the samples of a cycle.

        With `slot` that is selected right before, where the module has a ring; a device that is busy
        meanwhile may still show another.
        """
        blocks = self._blocks(self._header)
        write = None
        if slot is not None and self.registers.has_ring:
            select = self.registers["slot_select"]
            write = (select.address, select.encode(slot))
        raw = [words.tobytes() for words in await self._read(blocks, write)]
        image = decoded_image(blocks, raw, self._images.get(self._header))
        self._images[self._header] = image
        return image

    async def write_values(self, values: Mapping[str, ArrayLike | str]) -> None:
        """Write registers; neighbours go out in one request, so that the device takes them together."""
        registers = [self.registers[name] for name in values]
        for block in _adjacent_runs(registers):
            words = [register.encode(values[register.name]) for register in block]
            await self.modbus.write(block[0].address, np.concatenate(words), block[0].table)
        for register in registers:
            if register.bit is not None:
                (mask,) = register.bit_mask().tolist()
                put = mask if values[register.name] else 0
                await self.modbus.write_bits(register.address, 0xFFFF ^ mask, put)

    def _blocks(self, names: tuple[str, ...]) -> tuple[RegisterBlock, ...]:
        blocks = self._groups.get(names)
        if blocks is None:
            present = [self.registers[name] for name in names if name in self.registers]
            blocks = self._groups[names] = group_registers(
                present, self.modbus.link.max_registers, gaps=self.registers.gaps
            )
        return blocks

    async def _read(
        self, blocks: Sequence[RegisterBlock], write: tuple[int, Words] | None = None
    ) -> list[Words]:
        parts = [self.modbus.block(block.address, block.count, block.table) for block in blocks]
        at_once = READ_WRITE in self.registers.functions and bool(parts) and parts[0].table == "holding"
        try:
            await self.modbus.complete(*parts, write=write, at_once=at_once)
        except ModbusExceptionError as error:
            if error.code != _ILLEGAL_ADDRESS or not any(block.has_gaps for block in blocks):
                raise
            raise ModbusExceptionError(
                f"{error}; if the module refuses addresses between its registers, say `gaps: false` in map "
                f"{self.registers.name}",
                error.code,
            ) from error
        return [partial_block.words() for partial_block in parts]

    async def _read_until_stable(self, block: RegisterBlock, raw: bytes) -> bytes:
        """Read a block that takes several requests until two readings agree; `raw` is the first."""
        for attempt in range(_STABLE_READ_ATTEMPTS):  # each cut into other requests than the one before
            part = self.modbus.block(block.address, block.count, block.table, fewer=1 - attempt % 2)
            await self.modbus.complete(part)
            before, raw = raw, part.words().tobytes()
            if before == raw:
                return raw
        raise ProtocolError(
            f"{self.modbus.link}: {block.count} registers from {block.address} "
            "change faster than they can be read"
        )


def _adjacent_runs(registers: list[Register]) -> list[list[Register]]:
    """Group whole registers, or coils, that lie side by side, at most as many as one request can write."""
    runs: list[list[Register]] = []
    whole = (register for register in registers if register.bit is None)
    for register in sorted(whole, key=lambda r: (r.table, r.address)):
        last = runs[-1] if runs and runs[-1][0].table == register.table else None
        if last and last[-1].end == register.address and register.end - last[0].address <= MAX_WRITE:
            last.append(register)
        else:
            runs.append([register])
    return runs
