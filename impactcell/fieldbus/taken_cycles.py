"""Which cycles have been taken, so that none is taken twice whatever a status block says. Pure.

A status block can be old, from a gateway that answers out of a store, or have a wrong bit. So neither a cycle
counter that goes back nor another session is proof that the module was started anew: what the header of the
capture shows decides, for the capture's CRC covers it.
"""

from collections import OrderedDict
from typing import Final

from impactcell.fieldbus.capture_ring import NextCapture, cycles_after, is_after
from impactcell.fieldbus.cycle_numbers import CycleNumbers, most_behind
from impactcell.records import CycleId

_SESSIONS: Final = 16
"""So many sessions are remembered that the module has left."""


class TakenCycles:
    """The last cycle taken, and what the headers of those before it looked like.

    Parameters
    ----------
    last : CycleId or None
        Last cycle taken; None: none ever.
    last_time_ns : int
        Its own time; 0 where that is not known.
    slots : int
        Cycles that the module's ring holds.
    numbers : CycleNumbers
        How it counts them.
    """

    def __init__(self, last: CycleId | None, last_time_ns: int, slots: int, numbers: CycleNumbers) -> None:
        self.last = last
        self._last_time_ns = last_time_ns
        self._slots = slots
        self._numbers = numbers
        self._headers: OrderedDict[CycleId, bytes] = OrderedDict()
        self._first_behind: CycleId | None = None
        self._sessions_left: OrderedDict[int, None] = OrderedDict()

    def add(self, cycle_id: CycleId, header: bytes, time_ns: int) -> None:
        """Take note of a cycle that has been taken, its header as it stands on the wire, and its own time."""
        if self.last is not None and self.last.session != cycle_id.session:
            self._sessions_left[self.last.session] = None
            while len(self._sessions_left) > _SESSIONS:
                self._sessions_left.popitem(last=False)
        self._sessions_left.pop(cycle_id.session, None)
        self.last, self._last_time_ns, self._first_behind = cycle_id, time_ns, None
        shown = self._as_shown(cycle_id)
        self._headers.pop(shown, None)
        self._headers[shown] = header
        while len(self._headers) > most_behind(self._slots):
            self._headers.popitem(last=False)

    def is_behind(self, cycle_id: CycleId) -> bool:
        """Whether it lies before the last one, unless the module has gone back to a session of before."""
        if self.last is None or cycle_id.session != self.last.session:
            return cycle_id.session in self._sessions_left
        return not is_after(cycle_id.cycle, self.last.cycle)

    def holds(self, shown: CycleId, header: bytes, time_ns: int, target: NextCapture) -> bool:
        """Whether the capture that the window shows has been taken before, as far as can be known.

        Parameters
        ----------
        shown : CycleId
            As the header says.
        header : bytes
            Its words.
        time_ns : int
            Its own time; 0 where the module's clock is not set.
        target : NextCapture
            Where the status block has led to.
        """
        known = self._headers.get(self._as_shown(shown))
        if known is not None:
            return known == header
        if not self.is_behind(shown):
            return False
        if time_ns > self._last_time_ns > 0:
            return False
        # Nobody knows this cycle, and no clock tells. One that goes on and on behind the last cycle is no old
        # reply any more; a ring still holds what came meanwhile, of one buffer a cycle is lost.
        if self._first_behind is None or self._first_behind.session != shown.session:
            self._first_behind = CycleId(shown.session, target.counter)
        return cycles_after(self._first_behind.cycle, target.counter) < max(1, self._slots // 2)

    def _as_shown(self, cycle_id: CycleId) -> CycleId:
        """Return what the module shows for a cycle, whichever of its lives that is numbered for."""
        return CycleId(cycle_id.session, self._numbers.shown(cycle_id.cycle))
