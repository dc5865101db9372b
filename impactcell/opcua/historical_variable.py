"""Spans of time that HistoryRead asks about, and reading them page by page (Part 11, 6.5.3)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Final

from asyncua import ua

from impactcell.opcua.binary_codec import StatusCodeError
from impactcell.opcua.host_interface import HistoricalValue, HistoricalValues, HistoryProvider, HistoryRequest
from impactcell.opcua.variable_store import moment, nanoseconds

VALUES_PER_PAGE: Final = 1_000
"""Values, events or aggregates in one answer; more come by continuation point."""
BEGINNING: Final = ua.get_win_epoch()
"""Times up to here mean that none was given (Part 6, 5.2.2.5)."""
NO_BOUND: Final = ua.StatusCode(ua.StatusCodes.BadBoundNotFound)


@dataclass(frozen=True, slots=True)
class ReadRange:
    """A question about a span of time, both ends included.

    Attributes
    ----------
    left : int or None
        Number of values still wanted, None for all.
    bounds : tuple of int, or None
        Start and end in the direction of the question, where the values that bound it are wanted too.
    """

    start_ns: int | None
    end_ns: int | None
    newest_first: bool
    remaining: int | None
    resume: bytes | None = None
    bounds: tuple[int, int] | None = None

    def request(self) -> HistoryRequest:
        """Ask for the next page."""
        limit = VALUES_PER_PAGE if self.remaining is None else min(VALUES_PER_PAGE, self.remaining)
        return HistoryRequest(self.start_ns, self.end_ns, limit, self.newest_first, self.resume)


def remaining_range(current: ReadRange, returned: int, resume: bytes | None) -> ReadRange | None:
    """Say what is left to ask after a page; None at the end."""
    remaining = None if current.remaining is None else current.remaining - returned
    if resume is None or remaining == 0:
        return None
    return replace(current, remaining=remaining, resume=resume)


def read_range(
    start: datetime | None, end: datetime | None, max_values: int, *, bounds: bool = False
) -> ReadRange:
    """Read the bounds of a question: two of start, end and number are needed.

    The start belongs to the span and the end does not, in whichever direction time runs.

    Raises
    ------
    FaultError
        BadInvalidTimestampArgument.
    """
    start_ns = nanoseconds(start) if start is not None and start > BEGINNING else None
    end_ns = nanoseconds(end) if end is not None and end > BEGINNING else None
    remaining = max_values or None
    if (start_ns is None) + (end_ns is None) + (remaining is None) > 1:
        raise StatusCodeError(ua.StatusCodes.BadInvalidTimestampArgument)
    if start_ns is None:
        # Backwards from the end, which is where the question begins and so belongs to it.
        return ReadRange(None, end_ns, newest_first=True, remaining=remaining)
    if end_ns is None:
        return ReadRange(start_ns, None, newest_first=False, remaining=remaining)
    ends = (start_ns, end_ns) if bounds else None
    if start_ns > end_ns:
        return ReadRange(end_ns + 1, start_ns, newest_first=True, remaining=remaining, bounds=ends)
    return ReadRange(
        start_ns, max(end_ns - 1, start_ns), newest_first=False, remaining=remaining, bounds=ends
    )


class HistoricalVariable:
    """One stored variable."""

    def __init__(self, history: HistoryProvider, node: ua.NodeId) -> None:
        self._history = history
        self._node = node

    async def page(self, current: ReadRange) -> tuple[Sequence[HistoricalValue], ReadRange | None]:
        """Read a page, and say what is left."""
        page = await self._history.read_values(self._node, current.request())
        return page.values, remaining_range(current, len(page.values), page.resume)

    async def ends(self) -> tuple[int, int] | None:
        """Find the times of the first and the last stored value."""
        first = await self._nearest(None, later=True)
        last = await self._nearest(None, later=False)
        if not first.values or not last.values:
            return None
        return first.values[0].time_ns, last.values[0].time_ns

    async def bound(self, time_ns: int, *, later: bool) -> ua.DataValue:
        """Find the value at a time, or the nearest on one side; BadBoundNotFound where there is none."""
        page = await self._nearest(time_ns, later=later)
        if page.values:
            return data_value(page.values[0])
        return ua.DataValue(None, NO_BOUND, moment(time_ns), moment(time_ns))

    async def _nearest(self, time_ns: int | None, *, later: bool) -> HistoricalValues:
        start_ns, end_ns = (time_ns, None) if later else (None, time_ns)
        request = HistoryRequest(start_ns, end_ns, limit=1, newest_first=not later)
        return await self._history.read_values(self._node, request)


def data_value(value: HistoricalValue) -> ua.DataValue:
    """Make the DataValue of a stored value."""
    variant = ua.Variant(value.value, ua.VariantType.Double)
    return ua.DataValue(variant, ua.StatusCode(value.status), moment(value.time_ns), moment(value.time_ns))
