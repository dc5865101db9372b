"""A module without a plant: it serves the cycles it is given, and lies where it is told to."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from impactcell.fieldbus.registers import REGISTER_SPACE, WIRE, RegisterMap, Words, registers_crc32

LAST_CYCLE: Final = 2**32 - 1
"""Largest cycle number: 32 bits."""
_FEW_CYCLES: Final = {"u16": 2**16, "bcd16": 10**4, "bcd32": 10**8}
"""After so many a counter of these types begins with 0 again."""
_NOT_OF_A_SLOT: Final = ("window_sequence", "capture_ready", "cycle_counter")
"""Read with a capture, but not part of it."""


class ScriptedDevice:
    """Register image of a module whose cycles come from `complete`.

    Parameters
    ----------
    registers : RegisterMap
        The layout it speaks; without a ring it has one buffer.
    session, counter : int
        Where its life begins.
    """

    def __init__(self, registers: RegisterMap, session: int = 1, counter: int = 0) -> None:
        self.registers = registers
        declared = {register.table for register in registers.registers.values()}
        self.image: Words = np.zeros(REGISTER_SPACE, dtype=WIRE)
        self.images: dict[str, Words] = {table: np.zeros(REGISTER_SPACE, dtype=WIRE) for table in declared}
        self.images["holding"] = self.image
        self.images.setdefault("input", self.image)  # without any of its own, the same image
        self.acknowledged: list[tuple[int, int]] = []
        self.on_read: list[tuple[int, Any]] = []
        """Pairs of an address and a function called when that address is read next."""
        self._ends = dict.fromkeys(self.images, 0)
        self._writable = {table: np.zeros(REGISTER_SPACE, dtype=bool) for table in ("holding", "coil")}
        for register in registers.registers.values():
            self._ends[register.table] = max(self._ends[register.table], register.end)
            if register.writable:
                self._writable[register.table][register.address : register.end] = True
            if register.expect is not None:
                self.put(register.name, register.expect)
        if self.images["input"] is self.image:
            self._ends["input"] = self._ends["holding"]
        self._status: slice | None = None
        if "status_crc32" in registers:
            self._status = slice(registers["state"].address, registers["status_crc32"].address)
        header = (register.name for register in registers.header())
        self._of_slot = [name for name in header if name not in _NOT_OF_A_SLOT]
        self._slots: list[dict[str, Words]] = []
        self._sequence = 2
        self._put_if_there("state", 1)
        self.start(session, counter)

    def _put_if_there(self, name: str, value: ArrayLike | str) -> None:
        if name in self.registers:
            self.put(name, value)

    def put_count(self, name: str, count: int) -> None:
        """Show what counts on, where there is such a register: a short one begins with 0 again."""
        if name in self.registers:
            few = _FEW_CYCLES.get(self.registers[name].kind)
            self.put(name, count if few is None else count % few)

    def put(self, name: str, value: ArrayLike | str) -> None:
        """Show `value` in a register."""
        register = self.registers[name]
        image = self.images[register.table]
        image[register.address : register.end] = self._encoded_beside(image, name, value)

    def _encoded_beside(self, image: Words, name: str, value: ArrayLike | str) -> Words:
        """Words of a value, in what else its registers show: other bits, or the rest of an array."""
        register = self.registers[name]
        words = image[register.address : register.end].copy()
        if register.bit is not None:
            mask = register.bit_mask()
            return (words & ~mask) | (mask if value else np.zeros_like(mask))
        if register.kind == "bit":
            value = np.minimum(np.asarray(value, dtype=np.int64), 1)
        encoded = register.encode(value)
        words[: encoded.size] = encoded
        return words

    def get(self, name: str) -> Any:
        """Return what a register shows."""
        register = self.registers[name]
        return register.decode(self.images[register.table][register.address : register.end])

    def start(self, session: int, counter: int = 0) -> None:
        """Begin a life: an empty ring, and the counter where it is told."""
        self._slots = [{} for _ in range(self.registers.slots)]
        self.put_count("session", session)
        self.put("cycle_counter", counter)
        self._put_if_there("ring_cycle", np.zeros(self.registers.slots, dtype=np.int64))
        self._selected = 0
        self._newest = 0
        self._show()

    @property
    def next_slot(self) -> int:
        """Slot that the next cycle goes to; the oldest is there."""
        return (self._newest + 1) % self.registers.slots

    @property
    def leaving(self) -> int | None:
        """Cycle of the ring that the next one will overwrite; None where none lies there."""
        if not (self.registers.has_ring and self._slots[self.next_slot]):
            return None
        return int(self.get("ring_cycle")[self.next_slot])

    def complete(self, samples: Mapping[str, ArrayLike], **header: float | str) -> int:
        """Finish a cycle: put it into the oldest slot and raise the counter; return its number.

        `samples` holds force, position and actuator in SI; `header` any register of the window.
        """
        cycle = self.after(int(self.get("cycle_counter")))
        slot = self.next_slot
        self._slots[slot] = self._encoded(slot, cycle, samples, header)
        if slot == self._selected:
            self._show()
        self._newest = slot
        if self.registers.has_ring:
            ring = np.array(self.get("ring_cycle"))
            ring[slot] = cycle
            self.put("ring_cycle", ring)
        self._put_if_there("newest_slot", slot)
        self.put("cycle_counter", cycle)
        return cycle

    @property
    def period(self) -> int:
        """After so many cycles the counter shows the same number again."""
        return _FEW_CYCLES.get(self.registers["cycle_counter"].kind, LAST_CYCLE)

    @property
    def has_cycle_0(self) -> bool:
        """Whether a cycle can have the number 0; of a long counter that is none."""
        return self.period < LAST_CYCLE

    def after(self, cycle: int, count: int = 1) -> int:
        """Return what the counter shows so many cycles after one."""
        return (cycle + count) % self.period if self.has_cycle_0 else (cycle + count - 1) % self.period + 1

    def _encoded(
        self, slot: int, cycle: int, samples: Mapping[str, ArrayLike], header: Mapping[str, float | str]
    ) -> dict[str, Words]:
        """Words of a capture, register by register; unused parts of arrays are left out."""
        registers = self.registers
        session = int(self.get("session")) if "session" in registers else 0
        values: dict[str, ArrayLike | str] = {
            "window_slot": slot, "window_session": session, "window_cycle": cycle
        }  # fmt: skip
        words = {name: registers[name].encode(samples[name]) for name in registers.arrays if name in samples}
        used = list(words.values())
        for name in registers.arrays:
            values[f"{name}_count"] = (
                words[name].size // registers[name].words_per_value if name in words else 0
            )
        values["sample_count"] = max((int(np.size(each)) for each in samples.values()), default=0)
        values |= header
        words |= {name: registers[name].encode(values[name]) for name in self._of_slot if name in values}
        if "capture_crc32" in registers and "capture_crc32" not in header:
            crc = registers["capture_crc32"]
            words[crc.name] = crc.encode(registers_crc32(self._before(crc.address, words), *used))
        return words

    def _before(self, end: int, words: Mapping[str, Words]) -> Words:
        """Return the registers of a slot's header up to an address, with 0 between those of the map."""
        first = min(self.registers[name].address for name in self._of_slot)
        block = np.zeros(end - first, dtype=WIRE)
        for name in self._of_slot:
            at = self.registers[name].address - first
            if name in words and name != "capture_crc32":
                block[at : at + words[name].size] = words[name]
        return block

    def _show(self) -> None:
        """Show the selected slot in the window, under a new sequence number."""
        self._sequence += 2
        self.put_count("window_sequence", self._sequence)
        self.put_count("window_sequence_after", self._sequence)
        slot = self._slots[self._selected]
        for name in (*self._of_slot, *self.registers.arrays):
            register = self.registers[name]
            shown = self.images[register.table][register.address : register.end]
            used = slot[name].size if name in slot else 0
            shown[:used] = slot.get(name, 0)
            shown[used:] = 0
        self._put_if_there("capture_ready", int(bool(slot)))

    def read(self, table: str, address: int, count: int) -> Words:
        """Return registers, or bits; LookupError beyond the map, NotImplementedError without such a table."""
        if table not in self.images:
            raise NotImplementedError(table)
        if address + count > self._ends[table]:
            raise LookupError(address)
        self._show_status_crc(address, count)
        for hook in [hook for hook in self.on_read if address <= hook[0] < address + count]:
            self.on_read.remove(hook)
            hook[1]()
        return self.images[table][address : address + count]

    def _show_status_crc(self, address: int, count: int) -> None:
        """Bring the CRC of the status block up to date where a reading of it begins or goes on."""
        if (
            self._status is not None
            and address < self._status.stop + 2
            and address + count > self._status.start
        ):
            self.put("status_crc32", registers_crc32(self.image[self._status]))

    def write(self, address: int, words: Words, table: str = "holding") -> None:
        """Write registers or coils; raises as `read`, LookupError also where the map lets none be written.

        ValueError for a slot that there is not.
        """
        if table not in self.images:
            raise NotImplementedError(table)
        if not self._writable[table][address : address + words.size].all():
            raise LookupError(address)
        written = range(address, address + words.size)
        if self.registers.has_ring and self._lies_in("slot_select", table, written):
            slot = int(words[self.registers["slot_select"].address - address])
            if slot >= self.registers.slots:
                raise ValueError(slot)
            if slot != self._selected:
                self._selected = slot
                self._show()
        self.images[table][address : address + words.size] = words
        if self._lies_in("acknowledge_cycle", table, written):
            told_by = next(
                (name for name in ("acknowledge_session", "session") if name in self.registers), ""
            )
            session = int(self.get(told_by)) if told_by else 0
            self.acknowledged.append((session, int(self.get("acknowledge_cycle"))))

    def write_coils(self, address: int, bits: Words) -> None:
        """Write coils; LookupError where the map lets none be."""
        self.write(address, bits, "coil")

    def _lies_in(self, name: str, table: str, written: range) -> bool:
        if name not in self.registers:
            return False
        return self.registers[name].table == table and self.registers[name].address in written
