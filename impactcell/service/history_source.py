"""The past of the cells for OPC UA, read from their journals."""

from collections.abc import Mapping

from impactcell.journal.history import HistoryQuery
from impactcell.scada import AlarmPage, HistoryRequest, HistoryValue, RefusedError, ValuePage
from impactcell.service.cell_task import CellTask
from impactcell.service.worker import CellWorker


class JournalHistory:
    """Implements `scada.HistorySource` for the running cells; one without a journal has no past."""

    def __init__(self, cells: Mapping[str, CellTask]) -> None:
        self._cells = cells

    def _worker(self, cell: str) -> CellWorker:
        if cell not in self._cells:
            raise RefusedError("BadResourceUnavailable", f"{cell}: its journal cannot be opened")
        return self._cells[cell].worker

    async def values(self, cell: str, variable: str, request: HistoryRequest) -> ValuePage:
        """Read stored values of a variable, named by its path."""
        page = await self._worker(cell).query_journal(
            lambda journal: journal.values(variable, _query(request))
        )
        if page is None:
            return ValuePage(())
        entries = tuple(HistoryValue(entry.time_ns, entry.value, entry.quality) for entry in page.entries)
        return ValuePage(entries, page.resume)

    async def alarms(self, cell: str, request: HistoryRequest) -> AlarmPage:
        """Read the transitions of the conditions of a cell."""
        page = await self._worker(cell).query_journal(lambda journal: journal.alarms(_query(request)))
        return AlarmPage(()) if page is None else AlarmPage(page.entries, page.resume)


def _query(request: HistoryRequest) -> HistoryQuery:
    return HistoryQuery(request.start_ns, request.end_ns, request.limit, request.newest_first, request.resume)
