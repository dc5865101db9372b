"""The register image of a module whose map may lack some registers, with its ring and acknowledgements."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactcell.fieldbus.registers import RegisterMap, Words
from simulator.scripted import LAST_CYCLE, ScriptedDevice


class RegisterImage:
    """Registers by name; what the map does not have is written nowhere and reads as 0."""

    def __init__(self, registers: RegisterMap, session: int) -> None:
        self.registers = registers
        self.session = session
        self._image = ScriptedDevice(registers, session)
        self._overwritten = 0
        self._acknowledged = 0

    def put(self, name: str, value: Any) -> None:
        """Show a value."""
        if name in self.registers:
            self._image.put(name, value)

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
            if session == int(self.get("session")) and cycle:
                self._acknowledged = cycle
                self.put("acknowledged_cycle", cycle)
        self._image.acknowledged.clear()

    @property
    def unacknowledged(self) -> int:
        """How many cycles have been made since the one that was acknowledged last."""
        return (int(self.get("cycle_counter")) - self._acknowledged) % LAST_CYCLE

    def complete(self, samples: Mapping[str, NDArray[np.float64]], header: Mapping[str, float | str]) -> int:
        """Put a cycle into the ring, counting the one that has to leave for it; returns its number."""
        counter = int(self.get("cycle_counter"))
        ring = np.atleast_1d(self.get("ring_cycle"))
        leaving = int(ring[self._image.next_slot])
        acknowledged = int(self.get("acknowledged_cycle"))
        if leaving and (counter - leaving) % LAST_CYCLE < (counter - acknowledged) % LAST_CYCLE:
            self._overwritten += 1
            self.put("overwritten_count", self._overwritten)
        in_map = {name: value for name, value in header.items() if name in self.registers}
        return self._image.complete(samples, **in_map)

    def count_from(self, cycle: int) -> None:
        """Go on counting after `cycle`; what was made before is waited for no longer."""
        self.put("cycle_counter", cycle)
        self._acknowledged = cycle

    def restart(self) -> int:
        """Empty the ring and set the counter to zero; returns the new session."""
        self.session = self.session % LAST_CYCLE + 1
        self._overwritten = self._acknowledged = 0
        self._image.start(self.session)
        return self.session
