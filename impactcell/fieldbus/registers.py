"""Register maps: what stands at which Modbus address.

Pure: a map is a value made from a mapping (the parsed map file), used by the service and the simulator alike.
A value is in SI on this side; a map's `scale` and `unit` say what the wire carries:
SI value = (raw code × scale + offset) × SI factor of the unit.
"""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from impactcell.errors import MapError
from impactcell.fieldbus.register_map.map_layout import REGISTER_SPACE, layout_faults, window_faults
from impactcell.fieldbus.register_map.map_registers import ARRAYS, HEADER, REQUIRED, missing_registers
from impactcell.fieldbus.register_map.map_validation import validate_map
from impactcell.fieldbus.register_map.register import Register, Value, Words
from impactcell.fieldbus.register_map.register_types import WIRE
from impactcell.process.file_format import newer_file

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


@dataclass(frozen=True, slots=True)
class RegisterMap:
    """A whole register layout, validated: nothing overlaps, nothing leaves the register space.

    Attributes
    ----------
    name : str
        The layout's name, for messages.
    registers : mapping
        Name to `Register`.
    constants : mapping
        What the module has no register for because it is always the same, SI, by the register's name.
    functions : tuple of int
        Functions that only some modules have, and this one has; see `map_validation`.
    gaps : bool
        Whether addresses between the registers of the map may be read with them.
    """

    name: str
    registers: Mapping[str, Register]
    constants: Mapping[str, float] = field(default_factory=dict)
    functions: tuple[int, ...] = ()
    gaps: bool = True

    @classmethod
    def from_mapping(cls, mapping: object) -> "RegisterMap":
        """Map from a parsed map file.

        Raises
        ------
        MapError
            Listing every fault: unknown keys, wrong types, overlaps, addresses outside 0..65535, missing
            registers. Of a map for a newer version it is told that it is one, and nothing else.
        """
        if isinstance(mapping, Mapping) and (is_newer := newer_file(mapping.get("format"))):
            raise MapError(f"the register map {is_newer}", [is_newer])
        if not isinstance(mapping, Mapping) or not isinstance(mapping.get("registers"), Mapping):
            raise MapError("register map: must be a mapping with format, name and registers")
        validated = validate_map(mapping)
        name, faults = validated.name, validated.faults
        registers = {key: Register(**values) for key, values in validated.registers.items()}
        faults += layout_faults(registers.values())
        faults += missing_registers(mapping["registers"])
        faults += window_faults(registers)
        if faults:
            raise MapError(f"register map {name}: " + "; ".join(faults), faults)
        return cls(name, registers, validated.constants, validated.functions, validated.gaps)

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
        return replace(self, registers=registers)

    @property
    def has_ring(self) -> bool:
        """Whether the module holds several captures; else it has one buffer."""
        return "ring_cycle" in self

    @property
    def slots(self) -> int:
        """Captures that the module holds."""
        return self["ring_cycle"].count if self.has_ring else 1

    @property
    def arrays(self) -> tuple[str, ...]:
        """Names of the channels that the module samples, in the order in which a CRC covers them."""
        return tuple(name for name in ARRAYS if name in self)

    def status(self) -> tuple[Register, ...]:
        """Return the registers that `status_crc32` covers, and itself; none where the map has none."""
        if "status_crc32" not in self:
            return ()
        first, last = self["state"], self["status_crc32"]
        inside = (r for r in self.registers.values() if r.table == first.table)
        return tuple(r for r in inside if first.address <= r.address <= last.address)

    def header(self) -> tuple[Register, ...]:
        """Return what is read with each cycle beside its samples, by table and address.

        Where nothing there says which cycle it is, the module's counter does.
        """
        names = HEADER if "window_cycle" in self else (*HEADER, "cycle_counter")
        present = (self.registers[name] for name in names if name in self)
        return tuple(sorted(present, key=lambda register: (register.table, register.address)))

    def covered(self) -> Register:
        """Return the register at which begins what `capture_crc32` covers of the header.

        Raises
        ------
        MapError
            If the map has no such CRC.
        """
        crc = self["capture_crc32"]
        outside = ("window_sequence", "capture_ready", "cycle_counter")
        return next(r for r in self.header() if r.table == crc.table and r.name not in outside)


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
