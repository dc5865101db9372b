"""Whether a service could have its journal at a path, asked without writing anything."""

from pathlib import Path

from impactcell.errors import ForeignJournalError, JournalError
from impactcell.journal.database import check_header, check_name, errors, open_database
from impactcell.journal.lock import check_file


def refusal(path: Path, cell: str) -> str:
    """Say why no service of `cell` can have this file as its journal; empty where it can, or may later.

    What is damaged is put aside when the service starts, and what cannot be opened now is waited for: neither
    is refused. Nothing is written; not for a process that has the journal open itself.
    """
    try:
        with errors(path):
            check_name(path)
            if not path.exists():
                return ""
            check_file(path)
            size = path.stat().st_size
        check_header(path)
        if size:  # an empty file becomes a journal
            open_database(path, cell, read_only=True).close()
    except ForeignJournalError as error:
        return str(error)
    except JournalError as error:
        return "" if error.retry else str(error)
    return ""
