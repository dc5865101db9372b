"""The files that a verb is given, looked at before any work is done."""

import os
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
    """Raise `error` for a file that cannot be, which would else be found after the work."""
    if file.is_dir():
        raise error(f"{file}: is a directory; name a file in it")
    if not file.parent.is_dir():
        raise error(f"{file}: cannot be written: there is no directory {file.parent}; make it first")


def check_directory(directory: Path, error: type[ImpactCellError]) -> None:
    """Raise `error` for a directory that cannot be written: a file, inside one, or in somebody else's."""
    if directory.exists() and not directory.is_dir():
        raise error(f"{directory}: is a file; name a directory")
    place = next(place for place in directory.absolute().parents if place.exists())
    if not place.is_dir():
        raise error(f"{directory}: cannot be written: {place} is a file")
    if not os.access(place, os.W_OK | os.X_OK):
        raise error(f"{directory}: cannot be written: you may not write in {place}; name another place")
