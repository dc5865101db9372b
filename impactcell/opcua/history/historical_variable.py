"""Spans of time that HistoryRead asks about, and reading them page by page (Part 11, 6.5.3)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Final

from asyncua import ua

from impactcell.opcua.address_space.variable_store import nanoseconds
from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.history.read_budget import ReadBudget
from impactcell.opcua.host_interface import HistoricalValue, HistoricalValues, HistoryProvider, HistoryRequest

VALUES_PER_PAGE: Final = 1_000
"""Values, events or aggregates of one node in one answer; more come by continuation point. `read_budget`
bounds the answer over all nodes."""
BEGINNING: Final = ua.get_win_epoch()
"""Times up to here mean that none was given (Part 6, 5.2.2.5)."""
NO_BOUND: Final = int(ua.StatusCodes.BadBoundNotFound)


@dataclass(frozen=True, slots=True)
class ReadRange:
    """A question about a span of time, both ends included, and how far it has been answered.

    Attributes
    ----------
    remaining : int or None
        Number of values still wanted; None for all of the span.
    resume : bytes or None
        Where the source goes on after the last page, in its own words; None at the beginning.
    per_answer : int or None
        Most values in one answer, as the client asks; None leaves that to the server.
    first_bound_ns, last_bound_ns : int or None
        Start and end in the direction of the question, while the values that bound it there are still wanted.
    is_read : bool
        Whether nothing but the last bound is left.
    """

    start_ns: int | None
    end_ns: int | None
    newest_first: bool
    remaining: int | None = None
    per_answer: int | None = None
    resume: bytes | None = None
    first_bound_ns: int | None = None
    last_bound_ns: int | None = None
    is_read: bool = False

    @property
    def limit(self) -> int:
        """Most values in the next answer."""
        return min(VALUES_PER_PAGE, self.remaining or VALUES_PER_PAGE, self.per_answer or VALUES_PER_PAGE)

    def request(self, limit: int) -> HistoryRequest:
        """Ask for the next page."""
        return HistoryRequest(self.start_ns, self.end_ns, limit, self.newest_first, self.resume)

    def after(self, returned: int, resume: bytes | None) -> "ReadRange | None":
        """Say what is left to ask after a page; None at the end."""
        remaining = None if self.remaining is None else self.remaining - returned
        if resume is None or remaining == 0:
            return None
        return replace(self, remaining=remaining, resume=resume)


def parse_read_range(
    start: datetime | None, end: datetime | None, max_values: int, *, bounds: bool = False
) -> ReadRange:
    """Check what a client asks, and make it a span: start, end and number, two of them (Part 11, 6.5.3.2).

    The start belongs to the span and the end does not, in whichever direction time runs; a `ReadRange`
    has both its ends, so the excluded one is moved by the nanosecond that times are counted in. With both
    ends the number is that of one answer, and more come by continuation point; with one it is that of all.

    Raises
    ------
    StatusCodeError
        BadInvalidTimestampArgument.
    """
    start_ns = nanoseconds(start) if start is not None and start > BEGINNING else None
    end_ns = nanoseconds(end) if end is not None and end > BEGINNING else None
    number = max_values or None
    if (start_ns is None) + (end_ns is None) + (number is None) > 1:
        raise StatusCodeError(ua.StatusCodes.BadInvalidTimestampArgument)
    if start_ns is None:
        # Backwards from the end, which is where the question begins and so belongs to it.
        return ReadRange(None, end_ns, newest_first=True, remaining=number)
    if end_ns is None:
        return ReadRange(start_ns, None, newest_first=False, remaining=number)
    if start_ns > end_ns:
        current = ReadRange(end_ns + 1, start_ns, newest_first=True, per_answer=number)
    else:
        current = ReadRange(start_ns, max(end_ns - 1, start_ns), newest_first=False, per_answer=number)
    return replace(current, first_bound_ns=start_ns, last_bound_ns=end_ns) if bounds else current


class HistoricalVariable:
    """One stored variable."""

    def __init__(self, history: HistoryProvider, node: ua.NodeId) -> None:
        self._history = history
        self._node = node

    async def read(
        self, current: ReadRange, budget: ReadBudget
    ) -> tuple[list[HistoricalValue], ReadRange | None]:
        """Read what one answer holds, bounds included, and say what is left."""
        limit, values = budget.room(current.limit), list[HistoricalValue]()
        first_ns = current.first_bound_ns
        if first_ns is not None:
            current = replace(current, first_bound_ns=None)
            bound = await self._bound(first_ns, later=current.newest_first)
            if bound.value is None or bound.time_ns != first_ns:  # a value at this very time is on the page
                values.append(bound)
            if len(values) == limit:
                return values, current
        while not current.is_read:
            page = await self._history.read_values(self._node, current.request(limit - len(values)))
            left = current.after(len(page.values), page.resume)
            values += page.values
            await budget.spend(len(page.values))
            if left is None and current.last_bound_ns is None:
                return values, None
            current = replace(current, is_read=True) if left is None else left
            if left is not None and (len(values) == limit or budget.is_spent):
                return values, left
        last_ns = current.last_bound_ns
        if last_ns is not None and len(values) == limit:
            return values, replace(current, is_read=True)
        if last_ns is not None:
            values.append(await self._bound(last_ns, later=not current.newest_first))
        return values, None

    async def page(self, current: ReadRange) -> tuple[Sequence[HistoricalValue], ReadRange | None]:
        """Read one page, without bounds or budget, and say what is left."""
        values = await self._history.read_values(self._node, current.request(current.limit))
        return values.values, current.after(len(values.values), values.resume)

    async def ends(self) -> tuple[int, int] | None:
        """Find the times of the first and the last stored value."""
        first = await self._nearest(None, later=True)
        last = await self._nearest(None, later=False)
        if not first.values or not last.values:
            return None
        return first.values[0].time_ns, last.values[0].time_ns

    async def _bound(self, time_ns: int, *, later: bool) -> HistoricalValue:
        """Find the value at a time, or the nearest on one side; BadBoundNotFound where there is none."""
        page = await self._nearest(time_ns, later=later)
        return page.values[0] if page.values else HistoricalValue(time_ns, None, NO_BOUND)

    async def _nearest(self, time_ns: int | None, *, later: bool) -> HistoricalValues:
        start_ns, end_ns = (time_ns, None) if later else (None, time_ns)
        request = HistoryRequest(start_ns, end_ns, limit=1, newest_first=not later)
        return await self._history.read_values(self._node, request)
