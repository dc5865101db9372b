"""When a cycle was made: by the module's clock, or by the service's where the module has none that is set."""

import time
from dataclasses import replace

from impactcell.fieldbus.plausibility import EARLIEST_NS
from impactcell.fieldbus.registers import RegisterMap
from impactcell.process.cell_logger import CellLogger
from impactcell.records import Capture


class CycleDates:
    """Dates the cycles of one module.

    Parameters
    ----------
    registers : RegisterMap
        Its layout.
    log : CellLogger
        Told once that the clock which the map has is not set.
    """

    def __init__(self, registers: RegisterMap, log: CellLogger) -> None:
        self._clock = registers.registers.get("cycle_time")
        self._log = log
        self._said_not_set = False

    def dated(self, capture: Capture, *, readable: bool) -> Capture:
        """Return a capture that has just been asked for with a date: now, where it has none of its own.

        A clock before 2000 is none that was set: it counts from power-up. Of a capture that is not `readable`
        the module's time is not known, which says nothing of its clock.
        """
        if capture.time_ns >= EARLIEST_NS:
            return capture
        if readable and self._clock is not None and not self._said_not_set:
            self._said_not_set = True
            self._log.warning(
                "register cycle_time (%d) shows no date, as of a clock that is not set. Until it does, a "
                "cycle has the time at which it was read; set the module's clock",
                self._clock.address, cycle=capture.cycle,
            )  # fmt: skip
        return replace(capture, time_ns=time.time_ns())
