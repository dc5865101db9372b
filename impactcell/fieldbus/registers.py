"""Register maps: what stands at which Modbus address.

Pure: a map is a value made from a mapping (the parsed map file), used by the service and the simulator alike.
A value is in SI on this side; a map's `scale` and `unit` say what the wire carries:
SI value = raw code × scale × SI factor of the unit.
"""

import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from impactcell.errors import MapError
from impactcell.fieldbus.map_registers import REQUIRED
from impactcell.fieldbus.map_validation import validate_map
from impactcell.fieldbus.register import KINDS, SI_FACTOR, WIRE, Register, Value, Words

__all__ = [
    "REGISTER_SPACE",
    "REQUIRED",
    "WIRE",
    "Register",
    "RegisterMap",
    "Value",
    "Words",
    "registers_crc32",
]

REGISTER_SPACE: Final = 65_536
"""Addresses of a table: 16 bits."""


@dataclass(frozen=True, slots=True)
class RegisterMap:
    """A whole register layout, validated: nothing overlaps, nothing leaves the register space.

    Attributes
    ----------
    name : str
        The layout's name, for messages.
    registers : mapping
        Name to `Register`.
    """

    name: str
    registers: Mapping[str, Register]

    @classmethod
    def from_mapping(cls, mapping: object) -> "RegisterMap":
        """Map from a parsed map file.

        Raises
        ------
        MapError
            Listing every fault: unknown keys, wrong types, overlaps, addresses outside 0..65535, missing
            registers.
        """
        if not isinstance(mapping, Mapping) or not isinstance(mapping.get("registers"), Mapping):
            raise MapError("register map: must be a mapping with format, name and registers")
        name, declared, faults = validate_map(mapping, units=SI_FACTOR, kinds=KINDS)
        registers = {key: Register(**values) for key, values in declared.items()}
        faults += _layout_faults(registers.values())
        faults += [
            f"register {key} is missing: {why}"
            for key, why in REQUIRED.items()
            if key not in mapping["registers"]
        ]
        faults += _window_faults(registers)
        if faults:
            raise MapError(f"register map {name}: " + "; ".join(faults), faults)
        return cls(name, registers)

    def __getitem__(self, name: str) -> Register:
        """Register called `name`; MapError where the map has none."""
        try:
            return self.registers[name]
        except KeyError:
            raise MapError(f"register map {self.name} has no register {name}") from None

    def __contains__(self, name: object) -> bool:
        """Whether the map has a register called `name`."""
        return name in self.registers

    def with_word_order(self, word_order: str) -> "RegisterMap":
        """Return the same layout with every value of several registers in another word order."""
        registers = {name: replace(r, word_order=word_order) for name, r in self.registers.items()}
        return RegisterMap(self.name, registers)

    @property
    def slots(self) -> int:
        """Captures the module's ring holds."""
        return self["ring_cycle"].count

    def status(self) -> tuple[Register, ...]:
        """Return the registers that `status_crc32` covers, and itself; none where the map has none."""
        if "status_crc32" not in self:
            return ()
        first, last = self["state"], self["status_crc32"]
        inside = (r for r in self.registers.values() if r.table == first.table)
        return tuple(r for r in inside if first.address <= r.address <= last.address)

    def header(self) -> tuple[Register, ...]:
        """Return the window's registers before its arrays, from the sequence number on, by address."""
        first = self["window_sequence"].address
        last = self["force"].address
        table = self["window_sequence"].table
        inside = (r for r in self.registers.values() if r.table == table and first <= r.address < last)
        return tuple(sorted(inside, key=lambda register: register.address))


def registers_crc32(*blocks: Words) -> int:
    """CRC-32 (IEEE 802.3) of registers as their bytes stand on the wire, block after block.

    Of a capture it covers the window's registers after `window_sequence` up to the one before
    `capture_crc32`, then the used part of force, of position and of actuator, in this order; of the status
    block all registers from `state` up to the one before `status_crc32`.
    """
    crc = 0
    for words in blocks:
        crc = zlib.crc32(np.ascontiguousarray(words, dtype=WIRE).data, crc)
    return crc


def _layout_faults(registers: Iterable[Register]) -> Iterator[str]:
    ordered = sorted(registers, key=lambda register: (register.table, register.address))
    for register in ordered:
        if register.end > REGISTER_SPACE:
            yield f"register {register.name} ends at {register.end - 1}, outside 0..{REGISTER_SPACE - 1}"
    for i, register in enumerate(ordered):
        for other in ordered[i + 1 :]:
            if other.table != register.table or other.address >= register.end:
                break
            if None not in (register.bit, other.bit) and register.bit != other.bit:
                continue
            yield f"registers {register.name} and {other.name} overlap at {other.address}"


def _window_faults(registers: Mapping[str, Register]) -> Iterator[str]:
    arrays = [registers[name] for name in ("force", "position", "actuator") if name in registers]
    window = [registers[name] for name in ("window_sequence", "window_sequence_after") if name in registers]
    if len({register.table for register in (*arrays, *window)}) > 1:
        yield "the capture window must lie in one table"
    elif (
        len(window) == 2
        and arrays
        and not all(
            window[0].end <= register.address and register.end <= window[1].address for register in arrays
        )
    ):
        yield "force, position and actuator must lie between window_sequence and window_sequence_after"
    if "ring_cycle" in registers and registers["ring_cycle"].count < 2:
        yield "register ring_cycle must be an array with one cycle number a slot"
