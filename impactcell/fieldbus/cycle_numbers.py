"""Numbers of cycles that a module counts with fewer digits than a year of production needs. Pure.

A counter of 16 bits begins anew after 65 536 cycles. Here cycles are numbered on: of all numbers that the
counter may mean, the one nearest to the last cycle taken.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

from impactcell.fieldbus.status_block import UNREADABLE, StatusBlock
from impactcell.records import CycleId

_PERIOD: Final[Mapping[str, int]] = {"u16": 2**16, "bcd16": 10**4, "bcd32": 10**8}
"""Cycles after which a counter of each type shows the same again, where those are few."""


@dataclass(frozen=True, slots=True)
class CycleNumbers:
    """Numbers cycles on; `period` is that of the module's counter, None where it is long enough.

    Examples
    --------
    >>> numbers = CycleNumbers.of("u16")
    >>> numbers.number(3, near=65_530), numbers.number(65_530, near=65_539), numbers.number(3, near=60)
    (65539, 65530, 3)
    """

    period: int | None

    @classmethod
    def of(cls, kind: str) -> "CycleNumbers":
        """Numbers of a counter of this type of register."""
        return cls(_PERIOD.get(kind))

    def number(self, shown: int, near: int) -> int:
        """Return the number of the cycle that a counter shows, not below 0; 0 for none."""
        if self.period is None:
            return shown
        behind = (near - shown) % self.period
        nearest = near - behind if 2 * behind < self.period else near - behind + self.period
        return nearest if nearest >= 0 else nearest + self.period

    def shown(self, number: int) -> int:
        """Return what a counter shows for a cycle."""
        return number if self.period is None else number % self.period

    def status(self, status: StatusBlock, last: CycleId | None) -> StatusBlock:
        """Return a status block with numbers that go on from the last cycle taken.

        A slot of the ring whose number cannot be read counts as empty.
        """
        if self.period is None and UNREADABLE not in status.ring:
            return status
        near = last.cycle if last is not None and last.session == status.session else 0
        counter = self.number(status.cycle_counter, near)
        ring = tuple(0 if cycle == UNREADABLE else self.number(cycle, counter) for cycle in status.ring)
        return replace(status, cycle_counter=counter, ring=ring)
