"""The files that a verb is given, looked at before any work is done."""

from pathlib import Path

from impactcell.errors import CampaignError, ImpactCellError
from impactcell.journal.store import Journal
from impactcell.process.console import print_note


def open_journal(journal: Path) -> Journal:
    """Open a cell's journal to read it.

    Raises
    ------
    CampaignError
        There is no such file.
    JournalError
        It is no journal, or one of another version.
    """
    if not journal.is_file():
        raise CampaignError(f"{journal}: there is no such journal; name the `file` of the cell's `journal`")
    return Journal(journal, None, read_only=True)


def note_damage(damage: str) -> None:
    """Say that a recorded capture cannot be read; the others are used."""
    print_note(f"{damage}; it is left out")


def check_output(file: Path, error: type[ImpactCellError]) -> None:
    """Raise `error` for a file whose directory is not there, which would else be found after the work."""
    if not file.parent.is_dir():
        raise error(f"{file}: cannot be written: there is no directory {file.parent}; make it first")
