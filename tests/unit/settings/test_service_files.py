"""What `check` says of files that the service works with, and whoever checks may not use."""

import os
from pathlib import Path

import pytest

from impactcell.journal.store import Journal
from impactcell.settings import read_cell
from impactcell.settings.judgement import judge_cell
from tests.unit.settings.test_impossible_paths import cell_file


@pytest.mark.parametrize("barred", ["", "cells.sqlite", "cells.sqlite-wal", "cells.sqlite.lock"])
def test_a_journal_that_cannot_be_written_is_a_note(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, barred: str
) -> None:
    """Who checks need not be the user that the service runs as."""
    look = os.access
    Journal(tmp_path / "cells.sqlite", "press-1").close()
    (tmp_path / "cells.sqlite-wal").touch()
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != tmp_path / barred and look(path, mode))
    findings = judge_cell(read_cell(cell_file(tmp_path, "journal.file", "cells.sqlite")))
    (note,) = [str(one) for one in findings if one.section == "journal"]
    path = tmp_path / barred
    assert f"cell.yaml:6:17: note: journal.file: {path} is not yours to write: a service that you" in note


def test_one_that_can_be_written_has_none(tmp_path: Path) -> None:
    cell = read_cell(cell_file(tmp_path, "journal.file", "cells.sqlite"))
    assert not [one for one in judge_cell(cell) if one.section == "journal"]
