"""Which cycle to read next from the module's ring, and how many are gone. Pure.

Cycle numbers run 1, 2, ... 4 294 967 295, 1, ...; 0 means none.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from impactcell.records import CycleId

CYCLE_PERIOD: Final = 2**32 - 1
"""Cycle numbers before the first comes again: 32 bits, 0 being none."""


_FEWER: Final = 8
"""So many times fewer cycles since a restart make it likely that the counter was kept."""


@dataclass(frozen=True, slots=True)
class NextCapture:
    """The cycle to read next.

    Attributes
    ----------
    slot : int
        Where the ring has it.
    counter : int
        The module's last complete cycle, as the status block has it.
    missed : int
        Cycles between the last one taken and this one, which the ring no longer has. After a restart it is
        what the module's counter says of those since, as far as that can be known: see `_made_before`.
    restarted : bool
        Whether the module was started anew since the last one taken. `missed` counts what was seen of the
        session before and not taken, and those of the new one; what else it made before the restart nobody
        knows.
    """

    cycle_id: CycleId
    slot: int
    counter: int
    missed: int
    restarted: bool


def cycles_after(after: int, to: int) -> int:
    """Return how many steps lead from cycle `after` to cycle `to`, 0 standing for before the first.

    >>> cycles_after(4294967295, 2), cycles_after(0, 3), cycles_after(7, 7)
    (2, 3, 0)
    """
    return to if after == 0 or to == 0 else (to - after) % CYCLE_PERIOD


def is_after(cycle: int, other: int) -> bool:
    """Whether `cycle` was made after `other`, both in one life of the module.

    >>> is_after(3, 2), is_after(2, 3), is_after(3, 3), is_after(1, 4294967295)
    (True, False, False, True)
    """
    return 0 < cycles_after(other, cycle) <= CYCLE_PERIOD // 2


def is_consistent(counter: int, ring: Sequence[int]) -> bool:
    """Whether the ring of a status block holds the cycle that its counter says was completed last."""
    return counter == 0 or counter in ring


def next_capture(
    last: CycleId | None,
    session: int,
    counter: int,
    ring: Sequence[int],
    skip: int = 0,
    seen: int | None = None,
    period: int | None = None,
) -> NextCapture | None:
    """Return the oldest cycle of the ring that comes after `last`, or None if there is nothing new.

    Parameters
    ----------
    last : CycleId or None
        Last cycle taken; None: none ever, then the ring's oldest comes first and nothing counts as missed.
    session, counter : int
        The module's present session and last complete cycle.
    ring : sequence of int
        Cycle held by each slot, 0 for an empty one.
    skip : int
        Leave out so many of the oldest, because they are overwritten faster than they are read.
    seen : int, optional
        Last complete cycle that the module was seen to have in the life of `last`.
    period : int, optional
        Cycles after which the module's counter shows the same again, where those are few.
    """
    if counter == 0 or last == CycleId(session, counter):
        return None
    ages = {cycles_after(cycle, counter): slot for slot, cycle in enumerate(ring) if cycle != 0}
    restarted = last is not None and (
        last.session != session or cycles_after(last.cycle, counter) > CYCLE_PERIOD // 2
    )
    if last is None or restarted:
        behind = CYCLE_PERIOD
        ages_to_read = sorted((age for age in ages if age <= CYCLE_PERIOD // 2), reverse=True)
    else:
        behind = cycles_after(last.cycle, counter)
        ages_to_read = sorted((age for age in ages if age < behind), reverse=True)
    if not ages_to_read:
        return None
    age = ages_to_read[min(skip, len(ages_to_read) - 1)]
    slot = ages[age]
    if last is None:
        missed = 0
    elif restarted:
        complete = len(ages_to_read) == len(ring)
        unread = 0 if seen is None else cycles_after(last.cycle, seen)
        made = _made_before(last.cycle, counter, len(ages_to_read), unread, period, complete=complete)
        missed = max(0, made - age)
    else:
        missed = max(0, behind - age - 1)
    return NextCapture(CycleId(session, ring[slot]), slot, counter, missed, restarted)


def _made_before(
    last: int, counter: int, held: int, unread: int, period: int | None, *, complete: bool
) -> int:
    """Return how many cycles before the newest are known to have been made since `last`, over a restart.

    A module counts from 1 again, goes on counting where it was, or begins where somebody set its counter. A
    ring that is not full tells which: it holds all that was made since the restart. Where it is full, the
    counter is taken to have gone on if that means by far fewer cycles since.

    Parameters
    ----------
    last, counter : int
        Cycle taken last, and the newest.
    held : int
        How many the ring holds.
    unread : int
        How many were seen to be complete before the restart, after `last`.
    period : int or None
        As of `next_capture`.
    complete : bool
        Whether it is full.
    """
    if period is None:
        since = cycles_after(last, counter)
    else:
        since, counter = (counter - last) % period, counter % period
    if held == counter:  # from 1 again, and all are there
        return unread + counter - 1
    went_on = held <= since <= (period or CYCLE_PERIOD) // 2  # a start empties the ring
    if complete and not (went_on and _FEWER * since < counter):
        return unread + (counter - 1 if counter <= CYCLE_PERIOD // 2 else 0)
    return since - 1 if went_on else unread
