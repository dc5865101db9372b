"""The files that a verb is given, looked at before any work is done."""

import os
from pathlib import Path

from impactcell.errors import CampaignError, ImpactCellError
from impactcell.journal.store import Journal
from impactcell.process.console import print_note
from impactcell.process.path_kind import Kind, kind_at


def open_journal(journal: Path, cell: str | None = None) -> Journal:
    """Open a cell's journal to read it; with the cell's name no other's.

    Raises
    ------
    CampaignError
        There is no such file, or nobody may look for it.
    JournalError
        It is no journal, one of another version, or of another cell.
    """
    if kind_of(journal, CampaignError) is not Kind.FILE:
        raise CampaignError(f"{journal}: there is no such journal; name the `file` of the cell's `journal`")
    return Journal(journal, cell, read_only=True)


def note_damage(damage: str) -> None:
    """Say that a recorded capture cannot be read; the others are used."""
    print_note(f"{damage}; it is left out")


def kind_of(path: Path, error: type[ImpactCellError], use: str = "read") -> Kind:
    """Look what lies at a path; raises `error` where nobody may look, or nothing can be called like this."""
    try:
        return kind_at(path)
    except OSError as fault:
        raise error(f"{path}: cannot be {use}: {fault.strerror}; name another") from fault


def check_output(file: Path, error: type[ImpactCellError]) -> None:
    """Raise `error` for a file that cannot be, which would else be found after the work."""
    if kind_of(file, error, "written") is Kind.DIRECTORY:
        raise error(f"{file}: is a directory; name a file in it")
    if kind_of(file.parent, error, "written") is not Kind.DIRECTORY:
        raise error(f"{file}: cannot be written: there is no directory {file.parent}; make it first")


def check_directory(directory: Path, error: type[ImpactCellError]) -> None:
    """Raise `error` for a directory that cannot be written: a file, inside one, or in somebody else's."""
    kind = kind_of(directory, error, "written")
    if kind is Kind.FILE:
        raise error(f"{directory}: is a file; name a directory")
    above = ((place, kind_of(place, error, "written")) for place in directory.absolute().parents)
    place, kind_above = next((place, kind) for place, kind in above if kind is not Kind.NOTHING)
    if kind_above is Kind.FILE:
        raise error(f"{directory}: cannot be written: {place} is a file")
    for written in [place, *([directory] if kind is Kind.DIRECTORY else [])]:
        if not os.access(written, os.W_OK | os.X_OK):
            raise error(f"{directory}: cannot be written: you may not write in {written}; name another place")
