"""Registers by name, over a client: neighbouring registers are read in as few requests as may be."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from impactcell.errors import ProtocolError
from impactcell.fieldbus.codec import MAX_WRITE
from impactcell.fieldbus.registers import Register, RegisterMap, Value, Words
from impactcell.fieldbus.transport import ModbusClient

_TORN_READS: Final = 8


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Neighbouring registers that are read together."""

    table: str
    address: int
    count: int
    registers: tuple[Register, ...]


def plan(registers: Iterable[Register], max_registers: int) -> tuple[Block, ...]:
    """Group registers into blocks of at most `max_registers`, cut only between values.

    A value that is larger than that is a block of its own.
    """
    blocks: list[list[Register]] = []
    for register in sorted(registers, key=lambda r: (r.table, r.address)):
        last = blocks[-1] if blocks else None
        if last and last[0].table == register.table and register.end - last[0].address <= max_registers:
            last.append(register)
        else:
            blocks.append([register])
    return tuple(
        Block(group[0].table, group[0].address, group[-1].end - group[0].address, tuple(group))
        for group in blocks
    )


class MappedDevice:
    """A device whose registers have names."""

    def __init__(self, client: ModbusClient, registers: RegisterMap) -> None:
        self.client = client
        self.registers = registers
        self._header = registers.header()
        self._plans: dict[tuple[str, ...], tuple[Block, ...]] = {}
        self._merged: dict[tuple[str, ...], tuple[list[dict[str, Value]], dict[str, Value]]] = {}
        self._last: dict[Block, tuple[bytes, dict[str, Value]]] = {}

    async def values(self, names: tuple[str, ...]) -> Mapping[str, Value]:
        """Read registers and decode them, in SI; those that the map does not have are left out.

        What shows the same words as before comes back as the very same mapping.
        """
        parts = [self._decoded(block, await self._block(block)) for block in self._blocks(names)]
        last = self._merged.get(names)
        if last is None or any(part is not before for part, before in zip(parts, last[0], strict=True)):
            last = self._merged[names] = (parts, {key: part[key] for part in parts for key in part})
        return last[1]

    def _decoded(self, block: Block, words: Words) -> dict[str, Value]:
        """Decode a block; what a poll finds unchanged, which is nearly always, is not decoded again."""
        raw = words.tobytes()
        last = self._last.get(block)
        if last is None or last[0] != raw:
            found = {
                register.name: register.decode(
                    words[register.address - block.address : register.end - block.address]
                )
                for register in block.registers
            }
            last = self._last[block] = (raw, found)
        return last[1]

    async def words(self, name: str, values: int) -> Words:
        """Read the words of the first `values` values of an array."""
        register = self.registers[name]
        count = values * register.words_per_value
        return await self.client.read(register.address, count, register.table)

    async def header(self) -> tuple[dict[str, Value], Words]:
        """Read the window's header: its values, and its words from `window_sequence` to the first array."""
        fields = self._header
        blocks = self._blocks(tuple(register.name for register in fields))
        first = fields[0].address
        words = np.zeros(fields[-1].end - first, dtype=">u2")
        found: dict[str, Value] = {}
        parts = [self.client.block(block.address, block.count, block.table) for block in blocks]
        await self.client.complete(*parts)
        for part in parts:
            words[part.address - first : part.address - first + part.count] = part.words()
        for register in fields:
            at = register.address - first
            found[register.name] = register.decode(words[at : at + register.words])
        return found, words

    async def write(self, values: Mapping[str, ArrayLike | str]) -> None:
        """Write registers; neighbours go out in one request, so that the device takes them together."""
        registers = [self.registers[name] for name in values]
        for block in _runs(registers):
            words = [register.encode(values[register.name]) for register in block]
            await self.client.write(block[0].address, np.concatenate(words))

    def _blocks(self, names: tuple[str, ...]) -> tuple[Block, ...]:
        blocks = self._plans.get(names)
        if blocks is None:
            present = [self.registers[name] for name in names if name in self.registers]
            blocks = self._plans[names] = plan(present, self.client.link.max_registers)
        return blocks

    async def _block(self, block: Block) -> Words:
        """Read a block; one that takes several requests is read until two readings agree."""
        words = await self.client.read(block.address, block.count, block.table)
        if block.count <= self.client.link.max_registers:
            return words
        for _ in range(_TORN_READS):
            again = await self.client.read(block.address, block.count, block.table)
            if np.array_equal(words, again):
                return words
            words = again
        raise ProtocolError(
            f"{self.client.link}: {block.count} registers from {block.address} "
            "change faster than they can be read"
        )


def _runs(registers: list[Register]) -> list[list[Register]]:
    """Group registers that lie side by side, at most as many as one request can write."""
    runs: list[list[Register]] = []
    for register in sorted(registers, key=lambda r: r.address):
        last = runs[-1] if runs else None
        if last and last[-1].end == register.address and register.end - last[0].address <= MAX_WRITE:
            last.append(register)
        else:
            runs.append([register])
    return runs
