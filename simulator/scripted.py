"""A module without a plant: it serves the cycles it is given, and lies where it is told to."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from impactcell.fieldbus.registers import REGISTER_SPACE, WIRE, RegisterMap, Words, registers_crc32

_ARRAYS: Final = ("force", "position", "actuator")
LAST_CYCLE: Final = 2**32 - 1
"""Largest cycle number: 32 bits."""


@dataclass(slots=True)
class _Slot:
    """Words of the window as one slot shows it, from `window_slot` up to `window_sequence_after`."""

    words: Words


class ScriptedDevice:
    """Register image of a module whose cycles come from `complete`.

    Parameters
    ----------
    registers : RegisterMap
        The layout it speaks.
    session, counter : int
        Where its life begins.
    """

    def __init__(self, registers: RegisterMap, session: int = 1, counter: int = 0) -> None:
        self.registers = registers
        self.image: Words = np.zeros(REGISTER_SPACE, dtype=WIRE)
        self.acknowledged: list[tuple[int, int]] = []
        self.on_read: list[tuple[int, Any]] = []
        """Pairs of an address and a function called when that address is read next."""
        self._window = registers["window_slot"].address
        self._after = registers["window_sequence_after"].address
        self._end = max(register.end for register in registers.registers.values())
        self._writable = np.zeros(REGISTER_SPACE, dtype=bool)
        for register in registers.registers.values():
            if register.writable:
                self._writable[register.address : register.end] = True
            if register.expect is not None:
                self.put(register.name, register.expect)
        self._status: slice | None = None
        if "status_crc32" in registers:
            self._status = slice(registers["state"].address, registers["status_crc32"].address)
        self._slots: list[_Slot] = []
        self._sequence = 2
        self.put("state", 1)
        self.start(session, counter)

    def put(self, name: str, value: ArrayLike | str) -> None:
        """Show `value` in a register."""
        words = self.registers[name].encode(value)
        address = self.registers[name].address
        self.image[address : address + words.size] = words

    def get(self, name: str) -> Any:
        """Return what a register shows."""
        register = self.registers[name]
        return register.decode(self.image[register.address : register.end])

    def start(self, session: int, counter: int = 0) -> None:
        """Begin a life: an empty ring, and the counter where it is told."""
        blank = np.zeros(self._after - self._window, dtype=WIRE)
        self._slots = [_Slot(blank) for _ in range(self.registers.slots)]
        self.put("session", session)
        self.put("cycle_counter", counter)
        self.put("ring_cycle", np.zeros(self.registers.slots, dtype=np.int64))
        self._selected = 0
        self._newest = 0
        self._show()

    @property
    def next_slot(self) -> int:
        """Slot that the next cycle goes to; the oldest is there."""
        return (self._newest + 1) % self.registers.slots

    def complete(self, samples: Mapping[str, ArrayLike], **header: float | str) -> int:
        """Finish a cycle: put it into the oldest slot and raise the counter; return its number.

        `samples` holds force, position and actuator in SI; `header` any register of the window.
        """
        cycle = int(self.get("cycle_counter")) % LAST_CYCLE + 1
        slot = self.next_slot
        words = self._encoded(slot, cycle, samples, header)
        self._slots[slot] = _Slot(words)
        ring = np.array(self.get("ring_cycle"))
        ring[slot] = cycle
        if slot == self._selected:
            self._show()
        self._newest = slot
        self.put("ring_cycle", ring)
        if "newest_slot" in self.registers:
            self.put("newest_slot", slot)
        self.put("cycle_counter", cycle)
        return cycle

    def _encoded(
        self, slot: int, cycle: int, samples: Mapping[str, ArrayLike], header: Mapping[str, float | str]
    ) -> Words:
        words = np.zeros(self._after - self._window, dtype=WIRE)
        values: dict[str, ArrayLike | str] = {
            "window_slot": slot,
            "window_session": int(self.get("session")),
            "window_cycle": cycle,
        }
        used = []
        for name in _ARRAYS:
            if name in samples:
                encoded = self.registers[name].encode(samples[name])
                used.append(encoded)
                values[f"{name}_count"] = encoded.size // self.registers[name].words_per_value
                at = self.registers[name].address - self._window
                words[at : at + encoded.size] = encoded
        values |= header
        for name, value in values.items():
            register = self.registers[name]
            at = register.address - self._window
            words[at : at + register.words] = register.encode(value)
        if "capture_crc32" in self.registers and "capture_crc32" not in header:
            register = self.registers["capture_crc32"]
            at = register.address - self._window
            words[at : at + 2] = register.encode(registers_crc32(words[:at], *used))
        return words

    def _show(self) -> None:
        """Show the selected slot in the window, under a new sequence number."""
        self._sequence += 2
        self.put("window_sequence", self._sequence)
        self.put("window_sequence_after", self._sequence)
        self.image[self._window : self._after] = self._slots[self._selected].words

    def read(self, table: str, address: int, count: int) -> Words:  # noqa: ARG002 - both tables are one here
        """Return registers; LookupError beyond the map."""
        if address + count > self._end:
            raise LookupError(address)
        self._show_status_crc(address, count)
        for hook in [hook for hook in self.on_read if address <= hook[0] < address + count]:
            self.on_read.remove(hook)
            hook[1]()
        return self.image[address : address + count]

    def _show_status_crc(self, address: int, count: int) -> None:
        """Bring the CRC of the status block up to date where a reading of it begins or goes on."""
        if (
            self._status is not None
            and address < self._status.stop + 2
            and address + count > self._status.start
        ):
            self.put("status_crc32", registers_crc32(self.image[self._status]))

    def write(self, address: int, words: Words) -> None:
        """Write registers; LookupError where the map does not let them be, ValueError for a bad slot."""
        if not self._writable[address : address + words.size].all():
            raise LookupError(address)
        select = self.registers["slot_select"].address
        if address <= select < address + words.size:
            slot = int(words[select - address])
            if slot >= self.registers.slots:
                raise ValueError(slot)
            if slot != self._selected:
                self._selected = slot
                self._show()
        self.image[address : address + words.size] = words
        if "acknowledge_cycle" in self.registers:
            acknowledge = self.registers["acknowledge_cycle"].address
            if address <= acknowledge < address + words.size:
                self.acknowledged.append(
                    (int(self.get("acknowledge_session")), int(self.get("acknowledge_cycle")))
                )
