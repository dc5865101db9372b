"""Numbers of cycles that a module counts with fewer digits than a year of production needs. Pure.

A counter of 16 bits begins anew after 65 536 cycles, and with each start of the module. Here cycles are
numbered on from the last one taken. Whether a counter that shows less has gone round, or the module has been
started anew, is told by its session; without one it was started anew if that takes far fewer cycles. One that
shows a little less than for the last cycle is that of an old reply, or of a module that was started anew: the
header of the capture decides, and numbers are then what the counter shows.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from impactcell.fieldbus.cycles.capture_ring import NextCapture
from impactcell.fieldbus.cycles.status_block import UNREADABLE, StatusBlock
from impactcell.records import CycleId

_PERIOD: Final[Mapping[str, int]] = {"u16": 2**16, "bcd16": 10**4, "bcd32": 10**8}
"""Cycles after which a counter of each type shows the same again, where those are few."""
_FEWEST_BEHIND: Final = 256
"""So many cycles behind the last one a gateway may still show, also of a module with one buffer."""
_MOST_AHEAD: Final = 2**25
"""More cycles than a module makes in an outage: at twenty a second, which no tap allows, in three weeks."""
_FEWER: Final = 8
"""So many times fewer cycles since a start make it likelier than that the counter has gone round."""


def most_behind(slots: int) -> int:
    """Return how far behind the last cycle taken an old reply may be, of a module with so many slots."""
    return max(2 * slots, _FEWEST_BEHIND)


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
        """Return the number that is nearest of those that a counter may mean, not below 0; 0 for none."""
        if self.period is None:
            return shown
        behind = (near - shown) % self.period
        nearest = near - behind if 2 * behind < self.period else near - behind + self.period
        return nearest if nearest >= 0 else nearest + self.period

    def shown(self, number: int) -> int:
        """Return what a counter shows for a cycle."""
        return number if self.period is None else number % self.period

    def of_new_life(self, target: NextCapture) -> NextCapture:
        """Return a cycle that has proved to be none of those before the last one, as its counter shows it."""
        cycle_id = replace(target.cycle_id, cycle=self.shown(target.cycle_id.cycle))
        return replace(target, cycle_id=cycle_id, counter=self.shown(target.counter))

    def status(self, status: StatusBlock, last: CycleId | None) -> StatusBlock:
        """Return a status block with numbers that go on from the last cycle taken.

        After a start of the module they are what its counter shows. A slot of the ring whose number cannot be
        read counts as empty. A batch that is announced begins at the cycle nearest to the counter. A 0 behind
        the last cycle is none: of an old reply it has been taken, and after a start nothing has been made.
        """
        if self.period is None and UNREADABLE not in status.ring:
            return status
        newest, is_behind = status.cycle_counter, False
        if self.period is not None and last is not None and last.session == status.session:
            behind = most_behind(len(status.ring))
            newest = _number_after(last.cycle, newest, self.period, behind, told=bool(status.session))
            is_behind = newest < last.cycle
        batch = status.batch
        if batch is not None:
            batch = replace(batch, from_cycle=self.number(batch.from_cycle, near=newest))
        ring = tuple(self._ring(status.ring, newest, is_behind=is_behind))
        is_none = status.cycle_counter == 0 and newest not in ring
        return replace(status, cycle_counter=0 if is_none else newest, ring=ring, batch=batch)

    def _ring(self, ring: Sequence[int], newest: int, *, is_behind: bool) -> Iterator[int]:
        """Give the numbers of the cycles in a ring; `is_behind` the last cycle taken is its newest one."""
        for slot, shown in enumerate(ring):
            if shown == UNREADABLE or (shown == 0 and is_behind):
                yield 0
            elif shown or self.period is None:
                yield self.number(shown, near=newest)
            else:
                yield _number_of_zero(ring, slot, newest, self.period)


def _number_of_zero(ring: Sequence[int], slot: int, counter: int, period: int) -> int:
    """Return which cycle a slot that shows 0 holds: none, unless those before and after it are beside it."""
    age = counter % period  # of the last cycle for which the counter shows 0
    follows = ring[slot - 1] == period - 1 or age == len(ring) - 1
    is_followed = age == 0 or ring[(slot + 1) % len(ring)] == 1
    return counter - age if age < len(ring) and follows and is_followed else 0


def _number_after(last: int, shown: int, period: int, most_behind: int, *, told: bool) -> int:
    """Return the number of the cycle that a counter shows some time after cycle `last` was taken.

    Parameters
    ----------
    last, shown, period : int
    most_behind : int
        So far behind `last` an old status block can be; a module that was started anew may be there, too.
    told : bool
        Whether the module would tell if it had been started anew.
    """
    ahead, behind = (shown - last) % period, (last - shown) % period
    if behind <= min(most_behind, last):
        return last - behind
    if told:
        goes_on = ahead <= _MOST_AHEAD
    else:
        goes_round = ahead > shown
        goes_on = not goes_round or (2 * ahead < period and ahead <= _FEWER * max(shown, 1))
    return last + ahead if goes_on else shown
