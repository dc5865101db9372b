"""The past of the cells for OPC UA, read from their journals."""

from collections.abc import Mapping

from impactcell.journal.history import Question
from impactcell.scada import AlarmPage, HistoryValue, RefusedError, ValuePage
from impactcell.service.cell_task import RunningCell
from impactcell.service.worker import Worker


class JournalHistory:
    """Implements `scada.HistorySource` for the running cells; one without a journal has no past."""

    def __init__(self, cells: Mapping[str, RunningCell]) -> None:
        self._cells = cells

    def _worker(self, cell: str) -> Worker:
        if cell not in self._cells:
            raise RefusedError("BadResourceUnavailable", f"{cell}: its journal cannot be opened")
        return self._cells[cell].worker

    async def values(
        self,
        cell: str,
        variable: str,
        start_ns: int | None,
        end_ns: int | None,
        limit: int,
        *,
        newest_first: bool = False,
        resume: bytes | None = None,
    ) -> ValuePage:
        """Read stored values of a variable, named by its path."""
        question = Question(start_ns, end_ns, limit, newest_first, resume)
        page = await self._worker(cell).read(lambda journal: journal.values(variable, question))
        if page is None:
            return ValuePage(())
        entries = tuple(HistoryValue(entry.time_ns, entry.value, entry.quality) for entry in page.entries)
        return ValuePage(entries, page.resume)

    async def alarms(
        self,
        cell: str,
        start_ns: int | None,
        end_ns: int | None,
        limit: int,
        *,
        newest_first: bool = False,
        resume: bytes | None = None,
    ) -> AlarmPage:
        """Read the transitions of the conditions of a cell."""
        question = Question(start_ns, end_ns, limit, newest_first, resume)
        page = await self._worker(cell).read(lambda journal: journal.alarms(question))
        return AlarmPage(()) if page is None else AlarmPage(page.entries, page.resume)
