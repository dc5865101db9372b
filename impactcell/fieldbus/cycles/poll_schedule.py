"""When to ask for the next cycle: often when one is due, else seldom. Pure; the caller brings the time."""

import math
from collections import deque
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
_IRREGULAR: Final = 0.02
"""Where cycles come quite irregularly, polls may be so much of the variation apart."""
_GAIN: Final = 0.25
"""Share of the newest cycle in the period and its variation: followed within some four cycles."""
_SOMEWHAT_LATE: Final = 4.0
"""So many margins beyond when it was due a cycle is still looked for as if it were."""
_LONGEST: Final = 3.0
"""A longer time between cycles, in periods, is a pause or a clock that was set, and counts as this."""
_REST: Final = 3.0
"""Round trips of rest between polls that no cycle is due for; one while one is."""
_ROUND_TRIPS: Final = 8
"""The shortest of so many polls is what the line takes; the others waited for a busy module or for us."""
_DRIFT: Final = 5e-4
"""The most by which the module's clock can be slow or fast."""
_UNKNOWN: Final = (-math.inf, math.inf)


class PollSchedule:
    """Learns the cycle period, how much it varies, and what the module's clock shows.

    Period and variation come from the cycles' own times, as far as the polls bear them out: the times at
    which a busy service sees them vary with its load, and would make it poll the more the less time it has.
    So does when the next one is due: a cycle seen late must not make the next one late as well. It came after
    the last poll that did not show it and before the one that did, so the lag from its own time to when it
    can be seen lies between two bounds. They close in from cycle to cycle; polls are dense from the earliest
    to the latest moment that they leave.
    """

    def __init__(self) -> None:
        self._last_poll_s = self._poll_before_s = -math.inf
        self._seen_s = math.inf
        self._shown_s = _UNKNOWN
        self._cycle_time_s: float | None = None
        self._period_s: float | None = None
        self._spread_s = 0.0
        self._lag_s = _UNKNOWN
        self._round_trips_s: deque[float] = deque(maxlen=_ROUND_TRIPS)
        self._first_poll_s: float | None = None

    def record_poll(self, sent_s: float, answered_s: float, *, new: bool) -> None:
        """Take note of a poll, and whether it showed a cycle that the one before did not."""
        if new:
            self._poll_before_s, self._seen_s = self._last_poll_s, answered_s
        self._last_poll_s = sent_s
        self._round_trips_s.append(answered_s - sent_s)
        if self._first_poll_s is None:
            self._first_poll_s = sent_s

    def update(self, cycle_time_s: float, cycles: int = 1, *, newest: bool = True) -> None:
        """Take note of when a cycle was made, on any clock.

        Parameters
        ----------
        cycle_time_s : float
        cycles : int
            How many after the one before; 0 if that is not known.
        newest : bool
            Whether it is the one that the last poll with something new showed.
        """
        passed_s = (
            math.nan if self._cycle_time_s is None or cycles <= 0 else cycle_time_s - self._cycle_time_s
        )
        shown_s = (self._poll_before_s, self._seen_s) if newest else _UNKNOWN
        # A clock may have been set, stand still or count in another unit; the polls cannot be so wrong.
        passed_s = min(max(passed_s, shown_s[0] - self._shown_s[1]), shown_s[1] - self._shown_s[0])
        self._shown_s = shown_s
        if passed_s > 0.0:
            period_s = passed_s / cycles
            if self._period_s is None:
                self._period_s, self._spread_s = period_s, 0.1 * period_s
            else:
                error_s = min(period_s, _LONGEST * self._period_s) - self._period_s
                self._period_s += _GAIN * error_s
                self._spread_s += _GAIN * (abs(error_s) - self._spread_s)
        self._cycle_time_s = cycle_time_s
        if newest:
            self._lag_s = self._bounds(self._poll_before_s - cycle_time_s, self._seen_s - cycle_time_s)

    def _bounds(self, least_s: float, most_s: float) -> tuple[float, float]:
        """Bounds of the lag, given those that the newest cycle shows."""
        period_s = self._period_s or 0.0
        low_s, high_s = self._lag_s[0] - _DRIFT * period_s, self._lag_s[1] + _DRIFT * period_s
        if most_s < low_s or least_s > high_s + period_s:  # sooner than it could be, or a clock was set
            return least_s, most_s
        if least_s > high_s:  # held up in the module: once, or from now on
            high_s += _GAIN * (least_s - high_s)
        high_s = min(high_s, most_s)
        return min(max(low_s, least_s), high_s), high_s

    def delay_s(self, now_s: float) -> float:
        """Return the wait before the next poll: a round trip or three at least, so that a slow line rests."""
        round_trip_s = min(self._round_trips_s, default=0.0)
        rest_s = _REST * round_trip_s
        low_s, high_s = self._lag_s
        if self._cycle_time_s is None or self._period_s is None or low_s == -math.inf:
            waited_s = 0.0 if self._first_poll_s is None else now_s - self._first_poll_s
            return max(rest_s, _between(QUIET_S, 0.01 * waited_s))
        fine_s = max(FINE_S, self._spread_s, 0.5 * (high_s - low_s))
        coarse_s = _between(COARSE_S, _IRREGULAR * self._spread_s)
        least_s = max(round_trip_s, min(fine_s, coarse_s))
        quiet_s = max(rest_s, QUIET_S, coarse_s)
        due_s = self._cycle_time_s + self._period_s
        margin_s = 2.0 * self._spread_s + FINE_S
        early_s = due_s + low_s - margin_s - now_s
        if early_s > 0.0:
            regular = 10.0 * margin_s < self._period_s
            return max(least_s, min(early_s, REGULAR_S if regular else quiet_s))
        overdue_s = now_s - due_s - high_s
        if overdue_s < margin_s:
            return least_s
        if overdue_s < _SOMEWHAT_LATE * margin_s:
            return max(least_s, coarse_s)
        if overdue_s < 3.0 * self._period_s:
            return quiet_s
        return max(quiet_s, min(0.1 * overdue_s, IDLE_S))


def _between(shortest_s: float, wait_s: float) -> float:
    """Limit a wait to what is never too long."""
    return min(max(shortest_s, wait_s), IDLE_S)
