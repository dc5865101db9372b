"""When a cycle was made: by the module's clock, or by the service's where the module has none that is set."""

import math
import time
from dataclasses import replace
from typing import Final

from impactcell.fieldbus.cycles.plausibility import EARLIEST_NS
from impactcell.fieldbus.register_map.register_types import SI_FACTOR
from impactcell.fieldbus.registers import Register, RegisterMap
from impactcell.process.cell_logger import CellLogger
from impactcell.records import Capture

_TOLERANCE_S: Final = 60.0
"""Two clocks that are set may be so far apart, and no cycle is dated after it was read by more [s]."""
_ZONE_S, _FARTHEST_ZONE_S = 900.0, 14 * 3600.0
"""Local times are ahead of UTC by a multiple of the one, at most by the other [s]."""
_FAR_BEHIND_S: Final = 365.25 * 86_400.0
"""A clock that is farther behind is told [s]: many begin with a year long gone after power-up."""
_REST_S: Final = 3600.0
"""Between two warnings of a clock that is ahead [s]."""


def seconds_ahead(time_ns: int) -> float:
    """Return by how much a time is ahead of now, s."""
    return 1e-9 * (time_ns - time.time_ns())


def clock_ahead(registers: RegisterMap, ahead_s: float) -> str:
    """Say that a clock which dates a cycle after now is wrong, and the way out; empty where it is not."""
    clock = registers.registers.get("cycle_time")
    if clock is None or ahead_s <= _TOLERANCE_S:
        return ""
    hours, minutes = divmod(round(ahead_s / 60.0), 60)
    zone_s = _ZONE_S * round(ahead_s / _ZONE_S)
    way_out = "set the module's clock to UTC"
    if 0.0 < zone_s <= _FARTHEST_ZONE_S and abs(ahead_s - zone_s) <= _TOLERANCE_S:
        way_out += f", or say `{_offset(clock, zone_s)}` at cycle_time in map {registers.name}"
    return (
        f"register cycle_time ({clock.address}) shows a time {hours} h {minutes} min ahead of this machine's "
        f"UTC: cycles and alarms are dated in the future; {way_out}"
    )


def _offset(clock: Register, zone_s: float) -> str:
    """Write what takes a local time back to UTC, as the map says it."""
    unit = "unit: ns, " if clock.is_code else ""
    return f"{unit}offset: {clock.offset - zone_s / SI_FACTOR[clock.unit or 'ns']:.15g}"


class CycleDates:
    """Dates the cycles of one module.

    Parameters
    ----------
    registers : RegisterMap
        Its layout.
    log : CellLogger
        Told that the clock which the map has is not set, or years behind this machine's: once. Or ahead of
        it: once, and again, no more than once an hour, if it gets farther ahead or was right meanwhile.
    """

    def __init__(self, registers: RegisterMap, log: CellLogger) -> None:
        self._clock = registers.registers.get("cycle_time")
        self._log = log
        self._registers = registers
        self._said_not_set = self._said_behind = False
        self._said_ahead_s = 0.0
        self._may_say_ahead_s = -math.inf
        self._watched = False

    def dated(
        self, capture: Capture, *, readable: bool, is_newest: bool, restarted: bool, now_s: float
    ) -> Capture:
        """Return a capture that has just been asked for with a date: now, where it has none of its own.

        A clock before 2000 is none that was set: it counts from power-up. Of a capture that is not `readable`
        the module's time is not known, which says nothing of its clock. How far that is off the newest cycle
        tells best: ahead any of them, behind one that was made since another was the newest one.

        Parameters
        ----------
        restarted : bool
            Whether this is the first cycle of another life of the module, or of another module.
        now_s : float
            By a clock that is never set.
        """
        self._watched &= not restarted
        if capture.time_ns >= EARLIEST_NS:
            if is_newest:
                self._tell_off(capture, now_s)
            return capture
        if readable and self._clock is not None and not self._said_not_set:
            self._said_not_set = True
            self._log.warning(
                "register cycle_time (%d) shows no date, as of a clock that is not set. Until it does, a "
                "cycle has the time at which it was read; set the module's clock",
                self._clock.address, cycle=capture.cycle,
            )  # fmt: skip
        return replace(capture, time_ns=time.time_ns())

    def _tell_off(self, capture: Capture, now_s: float) -> None:
        """Warn of a clock that is ahead, or farther ahead than was said, or years behind."""
        ahead_s = seconds_ahead(capture.time_ns)
        if told := clock_ahead(self._registers, ahead_s):
            if ahead_s > self._said_ahead_s + _TOLERANCE_S and now_s >= self._may_say_ahead_s:
                self._said_ahead_s, self._may_say_ahead_s = ahead_s, now_s + _REST_S
                self._log.warning("%s", told, cycle=capture.cycle)
        else:
            self._said_ahead_s = 0.0
        if self._clock is not None and self._watched and -ahead_s > _FAR_BEHIND_S and not self._said_behind:
            self._said_behind = True
            self._log.warning(
                "register cycle_time (%d) shows a time %d days behind this machine's UTC: cycles and alarms "
                "are dated in the past; set the module's clock to UTC",
                self._clock.address, -ahead_s // 86_400.0, cycle=capture.cycle,
            )  # fmt: skip
        self._watched = True
