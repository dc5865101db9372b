"""What a cell goes on from when the service starts: the state in its journal, or what is left of it."""

import logging
from dataclasses import replace

from impactcell import cell as core
from impactcell.cell import CellDesign
from impactcell.cell.model_change import model_digest
from impactcell.errors import JournalDamagedError
from impactcell.journal.database import unreadable_state
from impactcell.journal.store import Journal
from impactcell.journal.stored_forms import StoredState, unpack_state
from impactcell.positioning.model_hypotheses import with_model_accepted
from impactcell.process.cell_logger import CellLogger
from impactcell.serialization.tree import Unknown
from impactcell.service.journal_writer import JournalWriter

_log = logging.getLogger(__name__)


def restored_state(writer: JournalWriter, design: CellDesign, unknown: Unknown) -> StoredState:
    """Read the state that the journal holds; a new one where there is none.

    Its `last` is the cycle to go on behind: the last one that the state has taken in or, where a state of
    before has to do, the last one of the journal, so that no cycle is journalled twice. What taps said that
    the model lacks ends where another model is in service now, as it does on a reload.

    Parameters
    ----------
    writer : JournalWriter
        Is told where the state is damaged, and what is used instead.
    unknown : dict
        Is given the alarms of another version, to be kept for it.

    Raises
    ------
    ForeignJournalError
        The state is of another version; it is left as it is.
    """
    initial, journal = core.initial_state(design), writer.journal
    blob, is_newest = (None, False) if journal is None else _stored_state(journal, writer)
    if journal is None or blob is None:
        return StoredState(initial, last=writer.durable)
    try:
        stored = unpack_state(blob, initial, unknown)
    except ValueError as error:
        raise unreadable_state(journal.path, design.name, error) from error
    log = CellLogger(_log, design.name)
    for alarms in unknown.values():
        log.warning("the journal has alarms of another version; they are kept: %s", ", ".join(alarms))
    if stored.planner is not None and stored.cell.model_digest not in ("", model_digest(design.model)):
        stored = replace(stored, planner=with_model_accepted(stored.planner))
    last = stored.last if is_newest else writer.durable
    return replace(stored, last=last or writer.durable or stored.last)


def _stored_state(journal: Journal, writer: JournalWriter) -> tuple[bytes | None, bool]:
    """Return the state to go on from, and whether it is the last one: else it is the one kept beside it."""
    try:
        return journal.state(), True
    except JournalDamagedError as error:
        why = str(error)
    try:
        blob = journal.state_backup()
    except JournalDamagedError:
        blob = None
    writer.report(
        f"{why}; the state of an earlier cycle is used instead"
        if blob is not None
        else f"{why}; wear, batch, signature, and what positioning has learned, begin anew"
    )
    return blob, False
