"""When to ask for the next cycle: often when one is due, else seldom. Pure; the caller brings the time."""

from typing import Final

FINE_S: Final = 0.003
"""Between polls while a cycle is due to the millisecond."""
COARSE_S: Final = 0.008
"""The same, where it is not known so well."""
QUIET_S: Final = 0.015
"""Between polls before it is due: what an early cycle may have to wait."""
REGULAR_S: Final = 0.25
"""The same, where cycles come so regularly that none is early."""
IDLE_S: Final = 0.1
"""The same, once they have stopped coming."""
_GAIN: Final = 0.25
_LONGEST: Final = 3.0
"""A longer time between cycles, in periods, is a pause or a clock that was set, and counts as this."""
_DRIFT: Final = 5e-4
"""The most by which the module's clock can be slow or fast."""


class PollSchedule:
    """Learns the cycle period and how much it varies.

    Both come from the cycles' own times: those at which a busy service sees them vary with its load, and
    would make it poll the more the less time it has. So does when the next one is due: a cycle seen late must
    not make the next one late as well. What the module's clock shows is known from the cycle seen soonest.
    """

    def __init__(self) -> None:
        self._seen_s: float | None = None
        self._made_s: float | None = None
        self._period_s: float | None = None
        self._spread_s = 0.0
        self._offset_s = 0.0
        self._due_s = 0.0

    def saw_cycle(self, now_s: float) -> None:
        """Take note that a poll showed a new cycle."""
        self._seen_s = now_s

    def learn(self, made_s: float, cycles: int = 1) -> None:
        """Take note of when a cycle was made, on any clock, `cycles` after the one before."""
        if self._made_s is not None and cycles > 0 and made_s > self._made_s:
            period_s = (made_s - self._made_s) / cycles
            if self._period_s is None:
                self._period_s, self._spread_s = period_s, 0.1 * period_s
            else:
                error_s = min(period_s, _LONGEST * self._period_s) - self._period_s
                self._period_s += _GAIN * error_s
                self._spread_s += _GAIN * (abs(error_s) - self._spread_s)
        self._made_s = made_s
        if self._seen_s is not None and self._period_s is not None:
            self._offset_s += _DRIFT * self._period_s
            late_s = self._seen_s - made_s - self._offset_s
            if not 0.0 <= late_s < self._period_s:  # seen sooner than any, or a clock was set
                self._offset_s += late_s
            self._due_s = made_s + self._offset_s + self._period_s

    def delay_s(self, now_s: float, round_trip_s: float) -> float:
        """Return the wait before the next poll; at least three round trips, so that a slow line has rest."""
        fine_s = min(max(FINE_S, self._spread_s), COARSE_S)
        least_s = max(fine_s, 3.0 * round_trip_s if round_trip_s == round_trip_s else 0.0)
        if self._seen_s is None or self._period_s is None:
            return max(least_s, QUIET_S)
        margin_s = 2.0 * self._spread_s + FINE_S
        overdue_s = now_s - self._due_s
        if overdue_s < -margin_s:
            regular = 10.0 * margin_s < self._period_s
            return max(least_s, min(-margin_s - overdue_s, REGULAR_S if regular else QUIET_S))
        if overdue_s < margin_s:
            return least_s
        return max(least_s, min(IDLE_S, QUIET_S if overdue_s < 3.0 * self._period_s else 0.1 * overdue_s))
