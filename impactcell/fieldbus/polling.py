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


class PollSchedule:
    """Learns the cycle period and how much it varies.

    Both come from the cycles' own times: those at which a busy service sees them vary with its load, and
    would make it poll the more the less time it has.
    """

    def __init__(self) -> None:
        self._seen_s: float | None = None
        self._made_s: float | None = None
        self._period_s: float | None = None
        self._spread_s = 0.0

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

    def delay_s(self, now_s: float, round_trip_s: float) -> float:
        """Return the wait before the next poll; at least three round trips, so that a slow line has rest."""
        fine_s = min(max(FINE_S, self._spread_s), COARSE_S)
        least_s = max(fine_s, 3.0 * round_trip_s if round_trip_s == round_trip_s else 0.0)
        if self._seen_s is None or self._period_s is None:
            return max(least_s, QUIET_S)
        age_s = now_s - self._seen_s
        margin_s = 3.0 * self._spread_s + FINE_S
        until_due_s = self._period_s - margin_s - age_s
        if until_due_s > 0.0:
            regular = 10.0 * margin_s < self._period_s
            return max(least_s, min(until_due_s, REGULAR_S if regular else QUIET_S))
        if age_s < self._period_s + margin_s:
            return least_s
        overdue_s = age_s - self._period_s
        return max(least_s, min(IDLE_S, QUIET_S if overdue_s < 3.0 * self._period_s else 0.1 * overdue_s))
