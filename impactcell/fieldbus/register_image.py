"""What registers showed when they were read: their words, and the values in them. Pure."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from impactcell.fieldbus.registers import WIRE, Register, Value, Words


@dataclass(frozen=True, slots=True, eq=False)
class RegisterBlock:
    """Neighbouring registers that are read together."""

    table: str
    address: int
    count: int
    fields: tuple[tuple[Register, slice], ...]

    @property
    def end(self) -> int:
        """First address after it."""
        return self.address + self.count

    @property
    def has_gaps(self) -> bool:
        """Whether it holds addresses that belong to none of its registers."""
        return any(
            other.start > max(where.stop for _, where in self.fields[: i + 1])
            for i, (_, other) in enumerate(self.fields[1:])
        )

    @classmethod
    def of(cls, registers: Sequence[Register]) -> Self:
        """Make the block from the first to the last of `registers`, which are in the order of addresses."""
        first = registers[0].address
        fields = tuple((each, slice(each.address - first, each.end - first)) for each in registers)
        return cls(registers[0].table, first, registers[-1].end - first, fields)

    def decode(self, raw: bytes, before: bytes, values: Mapping[str, Value]) -> dict[str, Value]:
        """Values in its words `raw`, by name; of words as they were in `before` those are in `values`."""
        words = np.frombuffer(raw, WIRE)
        decoded: dict[str, Value] = {}
        for register, where in self.fields:
            part = slice(2 * where.start, 2 * where.stop)
            unchanged = raw[part] == before[part]
            decoded[register.name] = values[register.name] if unchanged else register.decode(words[where])
        return decoded


def group_registers(
    registers: Iterable[Register], max_registers: int, *, gaps: bool = True
) -> tuple[RegisterBlock, ...]:
    """Group registers into blocks of at most `max_registers`, cut only between values.

    A value that is larger than that is a block of its own. Without `gaps` the values of a block lie side by
    side.
    """
    blocks: list[list[Register]] = []
    for register in sorted(registers, key=lambda r: (r.table, r.address)):
        last = blocks[-1] if blocks and blocks[-1][0].table == register.table else None
        near = last is not None and (gaps or register.address <= last[-1].end)
        if last and near and register.end - last[0].address <= max_registers:
            last.append(register)
        else:
            blocks.append([register])
    return tuple(RegisterBlock.of(group) for group in blocks)


@dataclass(frozen=True, slots=True, eq=False)
class RegisterImage:
    """What registers showed when they were read.

    Attributes
    ----------
    values : mapping
        Name to value, in SI.
    """

    blocks: tuple[RegisterBlock, ...]
    raw: tuple[bytes, ...]
    values: Mapping[str, Value]

    def words(self, first: Register, end: int) -> Words:
        """Words from register `first` up to address `end`, as on the wire; 0 between those that were read."""
        words = np.zeros(end - first.address, dtype=WIRE)
        for block, raw in zip(self.blocks, self.raw, strict=True):
            begin, stop = max(first.address, block.address), min(end, block.end)
            if block.table == first.table and begin < stop:
                part = np.frombuffer(raw, WIRE)[begin - block.address : stop - block.address]
                words[begin - first.address : stop - first.address] = part
        return words


def decoded_image(
    blocks: tuple[RegisterBlock, ...], raw: Sequence[bytes], before: RegisterImage | None = None
) -> RegisterImage:
    """Decode what was read of blocks, block by block.

    Parameters
    ----------
    before : RegisterImage, optional
        What the same blocks showed before: most registers have not changed since, and keep their values.
    """
    values: dict[str, Value] = {}
    earlier = (b"",) * len(blocks) if before is None else before.raw
    earlier_values = {} if before is None else before.values
    for block, data, data_before in zip(blocks, raw, earlier, strict=True):
        values |= block.decode(data, data_before, earlier_values)
    return RegisterImage(blocks, tuple(raw), values)
