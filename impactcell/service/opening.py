"""A cell's worker on the cell's journal."""

from impactcell.errors import JournalError
from impactcell.journal.retention import Retention
from impactcell.service.factory import cell_design, retention_policy
from impactcell.service.journal_writer import open_journal
from impactcell.service.worker import CellWorker
from impactcell.settings import CellConfig


def opened_worker(cell: CellConfig) -> CellWorker:
    """Open the cell's journal, if it is to have one, and go on from what it holds.

    Raises
    ------
    JournalError
        The journal cannot be opened; nothing stays open.
    """
    settings = cell.settings.journal
    if settings is None:
        return CellWorker(cell_design(cell), None, Retention())
    journal, damage = open_journal(settings.file, cell.name)
    try:
        worker = CellWorker(cell_design(cell), journal, retention_policy(settings))
    except JournalError:
        journal.close()
        raise
    if damage:
        worker.tell_journal_event(damage)
    return worker
