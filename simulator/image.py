"""The register image of a module whose map may lack some registers, with its ring and acknowledgements."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactcell.fieldbus.registers import RegisterMap, Words
from simulator.scripted import LAST_CYCLE, ScriptedDevice


class RegisterImage:
    """Registers by name; what the map does not have is written nowhere and reads as 0.

    Attributes
    ----------
    unacknowledged : int
        How many cycles have been made since the one that was acknowledged last.
    """

    def __init__(self, registers: RegisterMap, session: int) -> None:
        self.registers = registers
        self.session = session
        self._image = ScriptedDevice(registers, session)
        self._overwritten = 0
        self.unacknowledged = 0

    def put(self, name: str, value: Any) -> None:
        """Show a value."""
        if name in self.registers:
            self._image.put(name, value)

    def put_code(self, name: str, words: Sequence[str]) -> None:
        """Show the code of the first of these words that the register has one for, if it has any."""
        if name not in self.registers:
            return
        numbers = {word: number for number, word in self.registers[name].codes.items()}
        shown = next((numbers[word] for word in words if word in numbers), None)
        if shown is not None:
            self._image.put(name, shown)

    def get(self, name: str) -> Any:
        """Return what a register shows."""
        return self._image.get(name) if name in self.registers else 0

    def read(self, table: str, address: int, count: int) -> Words:
        """Return words; LookupError beyond the map."""
        return self._image.read(table, address, count)

    def write(self, address: int, words: Words, table: str = "holding") -> None:
        """Write words and take acknowledgements; LookupError and ValueError as the device's `write`."""
        self._image.write(address, words, table)
        for session, cycle in self._image.acknowledged:
            if session == int(self.get("session")) and (cycle or self._image.has_cycle_0):
                self.unacknowledged = min(self.unacknowledged, self._made_since(cycle))
                self.put("acknowledged_cycle", cycle)
        self._image.acknowledged.clear()

    def _made_since(self, cycle: int) -> int:
        return (int(self.get("cycle_counter")) - cycle) % self._image.period

    def after(self, cycle: int, count: int) -> int:
        """Return what the counter shows so many cycles after one."""
        return self._image.after(cycle, count)

    def is_next(self, cycle: int) -> bool:
        """Whether the next cycle has this number, or a later one: of two ways round, the shorter."""
        return (int(self.get("cycle_counter")) + 1 - cycle) % self._image.period < self._image.period // 2

    def complete(self, samples: Mapping[str, NDArray[np.float64]], header: Mapping[str, float | str]) -> int:
        """Put a cycle into the ring, counting the one that has to leave for it; returns its number."""
        leaving = self._image.leaving
        if leaving is not None and self._made_since(leaving) < self.unacknowledged:
            self._overwritten += 1
            self._image.put_count("overwritten_count", self._overwritten)
        in_map = {name: value for name, value in header.items() if name in self.registers}
        self.unacknowledged += 1
        return self._image.complete(samples, **in_map)

    def count_from(self, cycle: int) -> None:
        """Go on counting after `cycle`; what was made before is waited for no longer."""
        self.put("cycle_counter", cycle)
        self.unacknowledged = 0

    def restart(self) -> int:
        """Empty the ring and set the counter to zero; returns the new session."""
        self.session = self.session % LAST_CYCLE + 1
        self._overwritten = self.unacknowledged = 0
        self._image.start(self.session)
        return self.session
