"""Spans of time that HistoryRead asks about, and reading them page by page (Part 11, 6.5.3)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Final

from asyncua import ua

from impactcell.opcua.binary_codec import FaultError
from impactcell.opcua.host_interface import HistoricalValue, HistoricalValues, HistoryProvider, HistoryRequest
from impactcell.opcua.node_values import moment, nanoseconds

PAGE: Final = 1_000
BEGINNING: Final = ua.get_win_epoch()
NO_BOUND: Final = ua.StatusCode(ua.StatusCodes.BadBoundNotFound)


@dataclass(frozen=True, slots=True)
class Span:
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
    left: int | None
    resume: bytes | None = None
    bounds: tuple[int, int] | None = None

    def request(self) -> HistoryRequest:
        """Ask for the next page."""
        limit = PAGE if self.left is None else min(PAGE, self.left)
        return HistoryRequest(self.start_ns, self.end_ns, limit, self.newest_first, self.resume)


def rest(span: Span, given: int, resume: bytes | None) -> Span | None:
    """Say what is left to ask after a page; None at the end."""
    left = None if span.left is None else span.left - given
    if resume is None or left == 0:
        return None
    return replace(span, left=left, resume=resume)


def span(start: datetime | None, end: datetime | None, most: int, *, bounds: bool = False) -> Span:
    """Read the bounds of a question: two of start, end and number are needed.

    The start belongs to the span and the end does not, in whichever direction time runs.

    Raises
    ------
    FaultError
        BadInvalidTimestampArgument.
    """
    begin = nanoseconds(start) if start is not None and start > BEGINNING else None
    finish = nanoseconds(end) if end is not None and end > BEGINNING else None
    left = most or None
    if (begin is None) + (finish is None) + (left is None) > 1:
        raise FaultError(ua.StatusCodes.BadInvalidTimestampArgument)
    if begin is None:
        # Backwards from the end, which is where the question begins and so belongs to it.
        return Span(None, finish, newest_first=True, left=left)
    if finish is None:
        return Span(begin, None, newest_first=False, left=left)
    ends = (begin, finish) if bounds else None
    if begin > finish:
        return Span(finish + 1, begin, newest_first=True, left=left, bounds=ends)
    return Span(begin, max(finish - 1, begin), newest_first=False, left=left, bounds=ends)


class Series:
    """One stored variable."""

    def __init__(self, history: HistoryProvider, node: ua.NodeId) -> None:
        self._history = history
        self._node = node

    async def page(self, asked: Span) -> tuple[Sequence[HistoricalValue], Span | None]:
        """Read a page, and say what is left."""
        page = await self._history.read_values(self._node, asked.request())
        return page.values, rest(asked, len(page.values), page.resume)

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
