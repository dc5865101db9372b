"""What the PLC says of batches through the registers: the scenario's PLC, or one that writes them. Pure."""

from simulator.image import RegisterImage
from simulator.scenario import Batch, Scenario

ANNOUNCED_CYCLES_AHEAD = 2
"""Cycles before its first one at which the scenario's PLC announces a batch."""


class BatchAnnouncer:
    """Which batch the PLC believes to be on the table.

    Attributes
    ----------
    batch_id : str
        Empty until something has been announced.
    """

    def __init__(self, scenario: Scenario, image: RegisterImage) -> None:
        self.batch_id = ""
        self._batches = [batch for batch in scenario.batches if batch.announced]
        self._image = image
        self._last: Batch | None = None
        self._sequence = 0
        self._coming: tuple[int, str] | None = None

    def restart(self) -> None:
        """Say it all again to a module that has forgotten it."""
        self._last = None
        self._coming = None

    def announce(self, strikes: int, cycle: int) -> None:
        """Announce what begins soon, after `strikes` strikes of the scenario and `cycle` on the counter."""
        begun = [batch for batch in self._batches if batch.from_cycle <= strikes + ANNOUNCED_CYCLES_AHEAD]
        if begun and begun[-1] is not self._last:
            self._last = begun[-1]
            from_cycle = self._image.after(cycle, max(begun[-1].from_cycle - strikes, 1))
            self._image.put("batch_from_cycle", from_cycle)
            self._image.put("batch_announced", begun[-1].id)
            self._image.put("batch_sequence", self._shown_sequence() + 1)
            if "batch_sequence" not in self._image.registers:
                self._coming = (from_cycle, begun[-1].id)
        self.take()

    def take(self) -> None:
        """Look whether an announcement has been made, and whether its batch is there."""
        if self._shown_sequence() != self._sequence:
            self._sequence = self._shown_sequence()
            self._coming = (int(self._image.get("batch_from_cycle")), str(self._image.get("batch_announced")))
        if self._coming is not None and self._image.is_next(self._coming[0]):
            self.batch_id = self._coming[1]
            self._coming = None

    def _shown_sequence(self) -> int:
        return int(self._image.get("batch_sequence"))
