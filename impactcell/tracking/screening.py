"""Is a reading usable, and where in time does it belong? Says why where something is wrong."""

import math
from dataclasses import dataclass, replace

LARGEST_FRICTION = 10.0  # a friction coefficient beyond this is a fault of the measurement
SMALLEST_STD = 1e-9


@dataclass(frozen=True, slots=True)
class Clock:
    """Which cycles have been seen.

    Attributes
    ----------
    base : int
        Added to the module's cycle number to get an index that never restarts.
    last : int
        Highest index so far; meaningless while `seen` is empty.
    seen : tuple of int
        The most recent indices, to tell a late cycle from a repeated one.
    time_ns : int
        Time of the newest cycle.
    period_s : float
        Present time between cycles; nan while unknown.
    """

    base: int = 0
    last: int = 0
    seen: tuple[int, ...] = ()
    time_ns: int = 0
    period_s: float = math.nan

    def number(self, index: int) -> int:
        """Cycle number as the module counts."""
        return index - self.base


@dataclass(frozen=True, slots=True)
class Place:
    """Where a cycle belongs: `passed` cycles after the newest one, or `lag` cycles before it."""

    index: int
    passed: int
    lag: int
    repeated: bool
    note: str = ""


def place(clock: Clock, cycle: int, time_ns: int, reorder_limit: int) -> tuple[Clock, Place]:
    """Find the place of a cycle and move the clock there."""
    index = cycle + clock.base
    if not clock.seen:
        return _seen(replace(clock, last=index, time_ns=time_ns), index, reorder_limit), Place(
            index, 0, 0, repeated=False
        )
    if index in clock.seen:
        return clock, Place(
            index, 0, 0, repeated=True, note=f"cycle {cycle} came twice, the second is ignored"
        )
    if index < clock.last - reorder_limit:
        base = clock.last + 1 - cycle
        note = f"cycle numbers restarted at {cycle}"
        index = clock.last + 1
        moved = _timed(replace(clock, base=base, last=index), time_ns, 1)
        return _seen(moved[0], index, reorder_limit), Place(
            index, 1, 0, repeated=False, note=_join(note, moved[1])
        )
    if index < clock.last:
        lag = clock.last - index
        return _seen(clock, index, reorder_limit), Place(
            index, 0, lag, repeated=False, note=f"cycle {cycle} came {lag} cycles late"
        )
    passed = index - clock.last
    timed, note = _timed(clock, time_ns, passed)
    seen = (*clock.seen[-reorder_limit:], index)
    clock = Clock(clock.base, index, seen, timed.time_ns, timed.period_s)
    return clock, Place(index, passed, 0, repeated=False, note=note)


def fault(value: float, std: float) -> tuple[str, bool]:
    """Say what is wrong with an estimate, and whether its value must not be used."""
    if not math.isfinite(value):
        return f"mu_s is {'missing' if math.isnan(value) else 'infinite'}, the cycle is not used", True
    if not 0.0 <= value <= LARGEST_FRICTION:
        return f"mu_s = {value:g} is outside 0 .. {LARGEST_FRICTION:g}, the cycle is not used", True
    if std == 0.0:
        return "the standard deviation of mu_s is zero, the usual one is used", False
    if std < 0.0 or std > LARGEST_FRICTION:
        return f"the standard deviation of mu_s is {std:g}, the usual one is used", False
    return "", False


def usable_std(std: float) -> float:
    """Return the standard deviation where it can be one, else nan."""
    return std if SMALLEST_STD <= std <= LARGEST_FRICTION else math.nan


def _timed(clock: Clock, time_ns: int, passed: int) -> tuple[Clock, str]:
    """Follow the period between cycles; a clock that goes back is reported and otherwise ignored."""
    if time_ns == 0 or clock.time_ns == 0:
        return replace(clock, time_ns=time_ns or clock.time_ns), ""
    elapsed = (time_ns - clock.time_ns) * 1e-9
    if elapsed <= 0.0:
        return replace(clock, time_ns=time_ns), f"the clock went back by {-elapsed:g} s"
    each = elapsed / passed
    if math.isnan(clock.period_s):
        return replace(clock, time_ns=time_ns, period_s=each), ""
    # a pause is not a slower rate: one period counts at most as twice the usual one
    period = clock.period_s + 0.05 * (min(each, 2.0 * clock.period_s) - clock.period_s)
    return replace(clock, time_ns=time_ns, period_s=period), ""


def _seen(clock: Clock, index: int, kept: int) -> Clock:
    return replace(clock, seen=(*clock.seen[-kept:], index))


def _join(*notes: str) -> str:
    return "; ".join(note for note in notes if note)
