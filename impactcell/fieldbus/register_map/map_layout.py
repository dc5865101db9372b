"""Whether the registers of a map can lie where it says, in their tables and beside each other. Pure."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from impactcell.fieldbus.register_map.map_registers import ARRAYS, HEADER, NAMES, TEXTS, WRITTEN
from impactcell.fieldbus.register_map.register import Register

REGISTER_SPACE: Final = 65_536
"""Addresses of a table: 16 bits."""
_OUTSIDE_CRC: Final = ("window_sequence", "capture_ready", "capture_crc32")
"""What is read with a header and may lie outside of what its CRC covers."""
_BETWEEN_SEQUENCES: Final = (
    "must lie between window_sequence and window_sequence_after: what is read before the one or after the "
    "other can change unseen; have the module show it there, or leave both out of the map: a capture without "
    "a CRC is then read twice"
)
"""What all of a capture owes to its sequence numbers, why, and the way out."""
_COUNTERS: Final = ("cycle_counter", "ring_cycle", "window_cycle", "session", "window_session")
"""What counts, or tells one start of the module from another."""
_LARGEST: Final[Mapping[str, int]] = {
    "u16": 2**16 - 1,
    "bcd16": 10**4 - 1,
    "bcd32": 10**8 - 1,
    "u32": 2**32 - 1,
}
"""Types that count from 0 up, to what; over OPC UA a cycle has 32 bits."""
_SIGNED: Final = ("i16", "i32", "i64")
"""Types that show -1, too."""
_COMMAND_OF_A_BIT: Final = "command_abort"
"""The only thing written that is on or off."""
_ECHOED: Final = {
    "acknowledge_cycle": "cycle_counter",
    "acknowledge_session": "session",
    "command_sequence": "command_accepted",
}
"""What is written of what was read, or counted on from it."""
_WHOLE: Final = (
    "slot_select", "newest_slot", "window_slot", "window_sequence", "window_sequence_after", "direction",
    "sample_count", "force_count", "position_count", "actuator_count", "capture_crc32", "status_crc32",
    "acknowledge_session", "acknowledge_cycle", "batch_sequence", "batch_from_cycle",
    "command_sequence", "command_accepted", "command_cycle",
)  # fmt: skip
"""What is compared or counted with, and so has no scale."""


def layout_faults(registers: Iterable[Register]) -> Iterator[str]:
    """Say which registers leave their table, or overlap."""
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


def window_faults(registers: Mapping[str, Register]) -> Iterator[str]:
    """Say what cannot be read as one capture, or is no number where one is counted with."""
    yield from _kind_faults(registers)
    for name in _WHOLE:
        if name in registers and not registers[name].is_code:
            yield f"register {name} must be a whole number, without scale, offset or unit"
    for name in _COUNTERS:
        if name not in registers:
            continue
        counter = registers[name]
        if not (counter.is_code and counter.kind in _LARGEST and counter.bit is None):
            yield f"register {name} must be u16, u32, bcd16 or bcd32, without scale: it counts"
    for written, read in _ECHOED.items():
        most = [_LARGEST.get(registers[name].kind, 0) for name in (written, read) if name in registers]
        if len(most) > 1 and most[0] < most[1]:
            yield f"register {written} must hold what {read} can show"
    arrays = [registers[name] for name in ARRAYS if name in registers]
    for register in arrays:
        if register.kind in ("string", "bit") or register.bit is not None:
            yield f"register {register.name} must be an array of numbers"
    if "ring_cycle" in registers and registers["ring_cycle"].count < 2:
        yield "register ring_cycle must be an array with one cycle number a slot"
    yield from _sequence_faults(registers, arrays)
    yield from _crc_faults(registers)


def _kind_faults(registers: Mapping[str, Register]) -> Iterator[str]:
    """Say what has to be a single number, a text, or writable."""
    for name in NAMES:
        register = registers.get(name)
        if register is None or name in ARRAYS:
            continue
        if register.count > 1 and name != "ring_cycle":
            yield f"register {name} must be a single value"
        if register.kind == "string" and name not in TEXTS:
            yield f"register {name} must be a number"
        if name in WRITTEN and not register.writable:
            yield f"register {name} must be writable: the service writes it"
        is_number = name in _WHOLE or (name in WRITTEN and name != _COMMAND_OF_A_BIT)
        if is_number and (register.kind == "bit" or register.bit is not None):
            yield f"register {name} must be a whole number, not a bit"
        if name == "command_direction" and register.kind not in _SIGNED:
            yield f"register {name} must be i16, i32 or i64: it is +1 or -1"


def _header_of(registers: Mapping[str, Register]) -> list[Register]:
    return [registers[name] for name in HEADER if name in registers]


def _sequence_faults(registers: Mapping[str, Register], arrays: list[Register]) -> Iterator[str]:
    """Between the two sequence numbers lies all that they watch over, for it is read from the first on."""
    window = [registers[name] for name in ("window_sequence", "window_sequence_after") if name in registers]
    if len(window) < 2:
        return
    first, last = window
    if len({register.table for register in (*arrays, first, last)}) > 1:
        yield "the capture window must lie in one table"
    elif not all(first.end <= register.address and register.end <= last.address for register in arrays):
        names = " and ".join(register.name for register in arrays)
        yield f"register{'s' * (len(arrays) > 1)} {names} {_BETWEEN_SEQUENCES}"
    for register in _header_of(registers):
        if register.table == first.table and not first.address <= register.address < last.address:
            yield f"register {register.name} {_BETWEEN_SEQUENCES}"


def _crc_faults(registers: Mapping[str, Register]) -> Iterator[str]:
    """Say what is not covered by the CRC: it covers one piece of a table, right before itself."""
    crc = registers.get("capture_crc32")
    if crc is None:
        return
    for register in _header_of(registers):
        inside = register.table == crc.table and register.end <= crc.address
        if not inside and register.name not in _OUTSIDE_CRC:
            yield f"register {register.name} must lie before capture_crc32, which covers it"
