"""The past of the cells, read from their journals beside the service that writes them.

A connection that can only read sees the last committed state and holds up no writer (SQLite's write-ahead
log). One thread reads for all viewers, so that they compete with each other and not with the cells.
"""

import asyncio
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final, TypeVar

from impactcell.journal.history import HistoryQuery
from impactcell.journal.store import Journal
from impactcell.journal.trend import Finished, Shift, TrendColumn, shifts, trend
from impactcell.records import Alarm

T = TypeVar("T")
Trend = tuple[tuple[TrendColumn, ...], tuple[Shift, ...]]
"""Columns of a chart, and the changes of the material in their time."""

SPANS_S: Final = {"hour": 3600.0, "shift": 8 * 3600.0, "month": 30 * 86_400.0}
"""Spans of a trend, seconds."""
COLUMNS: Final = 360
"""Columns of a trend."""
FRESH_S: Final = {"hour": 2.0, "shift": 10.0, "month": 60.0}
"""How long a trend that was read stands for all who ask for the same."""


class Past:
    """Reads journals in a thread of its own."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="page-past")
        self._trends: dict[tuple[Path, str], tuple[float, Trend]] = {}
        self._finished: dict[tuple[Path, str], Finished] = {}

    async def run(self, work: Callable[[], T]) -> T:
        """Do some work in the thread of the past, one thing after the other."""
        return await asyncio.get_running_loop().run_in_executor(self._thread, work)

    async def trend(self, journal: Path, span: str) -> Trend:
        """Read the trend over the last hour, shift or month.

        Raises
        ------
        JournalError
            The journal cannot be read.
        """
        return await self.run(lambda: self._trend(journal, span))

    async def alarms(self, journal: Path, limit: int) -> tuple[Alarm, ...]:
        """Read the last transitions of the alarms, newest first.

        Raises
        ------
        JournalError
            The journal cannot be read.
        """
        return await self.run(lambda: _alarms(journal, limit))

    def _trend(self, path: Path, span: str) -> Trend:
        read_s, read = self._trends.get((path, span), (-1e9, ((), ())))
        if time.monotonic() - read_s > FRESH_S[span]:
            end_ns, finished = time.time_ns(), self._finished.setdefault((path, span), Finished())
            start_ns = end_ns - int(SPANS_S[span] * 1e9)
            columns = trend(path, start_ns, end_ns, COLUMNS, finished)
            read = columns, shifts(path, start_ns, end_ns)
            self._trends[path, span] = time.monotonic(), read
        return read


def _alarms(path: Path, limit: int) -> tuple[Alarm, ...]:
    with Journal(path, None, read_only=True) as journal:
        return journal.alarms(HistoryQuery(limit=limit, newest_first=True)).entries
