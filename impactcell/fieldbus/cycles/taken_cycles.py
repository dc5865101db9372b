"""Which cycles have been taken, so that none is taken twice whatever a status block says. Pure.

A status block can be old, from a gateway that answers out of a store, or have a wrong bit. So neither a cycle
counter that goes back nor another session is proof that the module was started anew: what the header of the
capture shows decides, for the capture's CRC covers it.
"""

from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from impactcell.fieldbus.cycles.capture_ring import NextCapture, cycles_after, is_after
from impactcell.fieldbus.cycles.cycle_numbers import CycleNumbers, most_behind
from impactcell.fieldbus.cycles.plausibility import EARLIEST_NS
from impactcell.records import CycleId

LIVES: Final = 16
"""So many sessions are remembered that the module has left, or that another module had."""


@dataclass(frozen=True, slots=True)
class TakenBefore:
    """What was taken before the service was started, beside the last cycle.

    Attributes
    ----------
    lives : iterable of (CycleId, int)
        Last cycle of each session, and its own time, in the order in which they were left.
    serial_number : str
        Of the module that made the last cycle; empty where that is not known.
    """

    lives: Iterable[tuple[CycleId, int]] = ()
    serial_number: str = ""


NOTHING_BEFORE: Final = TakenBefore()
"""Of a first start."""


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
    before : TakenBefore, optional

    Attributes
    ----------
    last : CycleId or None
        Last cycle taken of the life in which the module is taken to be; None: none ever.
    serial_number : str
        Of the module that is read; empty where that is not known.
    is_new_life : bool
        Whether the module was started anew since, though it shows the same session.
    """

    def __init__(
        self,
        last: CycleId | None,
        last_time_ns: int,
        slots: int,
        numbers: CycleNumbers,
        before: TakenBefore = NOTHING_BEFORE,
    ) -> None:
        self.last = last
        self.serial_number = before.serial_number
        self.is_new_life = False
        self._last_time_ns = last_time_ns
        self._slots = slots
        self._numbers = numbers
        self._headers: OrderedDict[tuple[str, CycleId], bytes] = OrderedDict()
        self._first_behind: CycleId | None = None
        self._lives_left: OrderedDict[tuple[str, int], tuple[CycleId, int]] = OrderedDict(
            (("", left.session), (left, time_ns))
            for left, time_ns in before.lives
            if last is None or left.session != last.session
        )
        self._taken_of = None if last is None else (self.serial_number, last.session)

    def add(self, cycle_id: CycleId, header: bytes, time_ns: int) -> None:
        """Take note of a cycle that has been taken, its header as it stands on the wire, and its own time."""
        if self.last is not None and self.last.session != cycle_id.session:
            self._leave()
        self.forget(cycle_id.session)
        self._go_on(cycle_id, time_ns)
        self._taken_of = self.serial_number, cycle_id.session
        shown = self._as_shown(cycle_id)
        self._headers.pop(shown, None)
        self._headers[shown] = header
        while len(self._headers) > most_behind(self._slots):
            self._headers.popitem(last=False)

    def meet(self, serial_number: str) -> str:
        """Take note of which module answers; returns the one before, empty where it is not another one."""
        if serial_number in ("", self.serial_number):
            return ""
        before = self.serial_number
        if before:
            self._leave()
            self.last = None
        if not before and self._taken_of is not None:
            self._taken_of = serial_number, self._taken_of[1]
        self.serial_number = serial_number
        return before

    def left(self, session: int) -> CycleId | None:
        """Return the last cycle taken of a session that the module has left; None where it never did."""
        key = self._key(session)
        return None if key is None else self._lives_left[key][0]

    def resume(self, session: int) -> None:
        """Go on in a session that was left."""
        key = self._key(session)
        if key is not None:
            last, time_ns = self._lives_left.pop(key)
            self._leave()
            self._go_on(last, time_ns)

    def forget(self, session: int) -> None:
        """Take a session that was left for one that has not been met."""
        key = self._key(session)
        if key is not None:
            del self._lives_left[key]

    def begin_life(self) -> None:
        """Take it that the module was started anew since the last cycle, though its session is the same."""
        self.is_new_life = True

    def is_other_life(self, session: int) -> bool:
        """Whether this session is another one, or another module's, than that of the cycle taken last."""
        return self._taken_of not in (None, (self.serial_number, session))

    def is_same(self, cycle_id: CycleId, header: bytes, time_ns: int) -> bool | None:
        """Whether a header is that of a cycle which was the last one taken; None where nothing tells.

        By its own time where the module has a clock that is set, else by all that its header shows.
        """
        key = self._key(cycle_id.session)
        known_ns = self._last_time_ns if cycle_id == self.last or key is None else self._lives_left[key][1]
        if min(known_ns, time_ns) >= EARLIEST_NS:
            return known_ns == time_ns
        known = self._headers.get(self._as_shown(cycle_id))
        return known == header if known else None

    def is_behind(self, cycle_id: CycleId) -> bool:
        """Whether it lies before the last one, unless the module has gone back to a session of before."""
        if self.is_new_life:
            return False
        if self.last is None or cycle_id.session != self.last.session:
            return self._key(cycle_id.session) is not None
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

    def _as_shown(self, cycle_id: CycleId) -> tuple[str, CycleId]:
        """Return what the module shows for a cycle, whichever of its lives that is numbered for."""
        return self.serial_number, CycleId(cycle_id.session, self._numbers.shown(cycle_id.cycle))

    def _go_on(self, last: CycleId, time_ns: int) -> None:
        self.last, self._last_time_ns = last, time_ns
        self._first_behind, self.is_new_life = None, False

    def _leave(self) -> None:
        """Remember the session of the last cycle as one that was left."""
        if self.last is None:
            return
        self._lives_left[self.serial_number, self.last.session] = self.last, self._last_time_ns
        while len(self._lives_left) > LIVES:
            self._lives_left.popitem(last=False)

    def _key(self, session: int) -> tuple[str, int] | None:
        """Under what a session that was left is remembered: which module had it may not be known."""
        keys = (self.serial_number, session), ("", session)
        return next((key for key in keys if key in self._lives_left), None)
