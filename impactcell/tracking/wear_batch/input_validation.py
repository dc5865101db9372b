"""Is an estimate usable, and where in time does its cycle belong? Says why where something is wrong."""

import math
from dataclasses import dataclass, replace

LARGEST_FRICTION = 10.0
"""mu_s beyond this is a fault of the measurement: no dry pair of materials comes near."""
SMALLEST_STD = 1e-9
"""A declared standard deviation below this, in mu_s, is none: no sensor is so good."""
PERIOD_GAIN = 0.05
"""Share of each new period in the mean one."""
LONGEST_PERIOD = 2.0
"""A period counts at most as so many of the usual one: a pause is not a slower rate."""
KEPT_NUMBERINGS = 16
"""Starts of the module over which it is remembered how it counted before."""


@dataclass(frozen=True, slots=True)
class CycleClock:
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
    session : int
        That of the newest cycle: changes when the module has restarted and counts anew; 0 while unknown.
    earlier : tuple of (int, int)
        Of each time that the module has counted anew, oldest first: the index from which on it did, and the
        base until then.
    """

    base: int = 0
    last: int = 0
    seen: tuple[int, ...] = ()
    time_ns: int = 0
    period_s: float = math.nan
    session: int = 0
    earlier: tuple[tuple[int, int], ...] = ()

    def number(self, index: int) -> int:
        """Give the number that the module gave to a cycle, however often it has counted anew since.

        0 where it is not known any more how it counted then.
        """
        bases = (base for until, base in self.earlier if index < until)
        return max(index - next(bases, self.base), 0)


@dataclass(frozen=True, slots=True)
class CycleTiming:
    """Where a cycle belongs: `passed` cycles after the newest one, or `lag` cycles before it.

    That is not known of one that is `doubted`: its number may be wrong.
    """

    index: int
    passed: int
    lag: int
    repeated: bool
    note: str = ""
    doubted: bool = False


def update_clock(
    clock: CycleClock,
    cycle: int,
    time_ns: int,
    reorder_limit: int,
    session: int = 0,
    farthest: float = math.inf,
    *,
    restarted: bool = False,
) -> tuple[CycleClock, CycleTiming]:
    """Find where a cycle belongs and move the clock there.

    A number that is too far ahead is in doubt, and does not move the clock: the next cycle does, past all
    that lie between, where it goes on from that number.

    Parameters
    ----------
    reorder_limit : int
        A cycle that comes at most this many cycles late is one that comes late; numbers farther back are
        those of a module that counts anew.
    session : int
        The module's; another one than before says that it counts anew, 0 says nothing.
    farthest : float
        Cycles ahead beyond which a number is in doubt.
    restarted : bool
        Whether the module is known to count anew from this cycle on, whatever it says of its session.
    """
    index, session = cycle + clock.base, session or clock.session
    if not clock.seen:
        timing = CycleTiming(index, 0, 0, repeated=False)
        return CycleClock(clock.base, index, (index,), time_ns, session=session), timing
    is_new_session = restarted or clock.session not in (0, session)
    lag = clock.last - index
    if not is_new_session and (index == clock.last or index in clock.seen):
        note = f"cycle {cycle} came again, ignored"
        return clock, CycleTiming(index, 0, 0, repeated=True, note=note)
    seen, newest = clock.seen[-reorder_limit:], clock.seen[-1]
    if not is_new_session and 0 < lag <= reorder_limit:
        clock = replace(clock, seen=(*seen, index), session=session)
        late = f"{lag} cycle{'s' if lag > 1 else ''} late"
        return clock, CycleTiming(index, 0, lag, repeated=False, note=f"cycle {cycle} came {late}")
    jump = newest - clock.last
    goes_on = jump > reorder_limit and -reorder_limit < index - newest <= jump
    if not (is_new_session or goes_on) and -lag > farthest:
        note = f"cycle number {cycle} after {clock.number(clock.last)} is in doubt, not used"
        clock = replace(clock, seen=(*seen, index))
        return clock, CycleTiming(index, 0, 0, repeated=False, note=note, doubted=True)
    has_restarted = is_new_session or lag > 0
    base = clock.last + 1 - cycle if has_restarted else clock.base
    index = cycle + base
    passed = index - clock.last
    time_ns, period_s, note = _update_period(clock, time_ns, passed)
    if has_restarted:
        note = "; ".join(filter(None, (f"cycle numbers restarted at {cycle}", note)))
    earlier = clock.earlier
    if base != clock.base:
        earlier = (*earlier, (index, clock.base))[-KEPT_NUMBERINGS:]
    timing = CycleTiming(index, passed, 0, repeated=False, note=note)
    return CycleClock(base, index, (*seen, index), time_ns, period_s, session, earlier), timing


def validate_estimate(value: float, std: float) -> tuple[str, bool]:
    """Say what is wrong with an estimate, and whether its value must not be used."""
    if not math.isfinite(value):
        return f"mu_s is {'missing' if math.isnan(value) else 'infinite'}, the cycle is not used", True
    if not 0.0 <= value <= LARGEST_FRICTION:
        return f"mu_s = {value:g} is outside 0 .. {LARGEST_FRICTION:g}, the cycle is not used", True
    if math.isnan(std) or std == valid_std(std):
        return "", False
    said = f"{std:g}" if std else "zero"
    return f"the standard deviation of mu_s is {said}, the usual one is used", False


def valid_std(std: float) -> float:
    """Return the standard deviation where it can be one, else nan."""
    return std if SMALLEST_STD <= std <= LARGEST_FRICTION else math.nan


def _update_period(clock: CycleClock, time_ns: int, passed: int) -> tuple[int, float, str]:
    """Time and period after `passed` cycles; a clock that goes back is reported and otherwise ignored."""
    if time_ns == 0 or clock.time_ns == 0:
        return time_ns or clock.time_ns, clock.period_s, ""
    elapsed_s = (time_ns - clock.time_ns) * 1e-9
    if elapsed_s <= 0.0:
        return time_ns, clock.period_s, f"the clock went back by {-elapsed_s:g} s"
    period, usual = elapsed_s / passed, clock.period_s
    return (
        time_ns,
        period if math.isnan(usual) else usual + PERIOD_GAIN * (min(period, LONGEST_PERIOD * usual) - usual),
        "",
    )
