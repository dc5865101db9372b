"""Journals of earlier versions are opened with all that they hold."""

import json
import shutil
from pathlib import Path

import pytest

from impactcell.journal.store import Journal
from tests.data.contents import described, stored

DATA = Path(__file__).parents[2] / "data"


@pytest.mark.parametrize("version", ["journal-format-3"])
def test_all_that_an_older_journal_holds_is_read(tmp_path: Path, version: str) -> None:
    journal = tmp_path / "j.sqlite"
    shutil.copy(DATA / f"{version}.sqlite", journal)
    with Journal(journal, "press-1") as opened:
        read = described(stored(opened), opened)
    assert read == json.loads((DATA / f"{version}.json").read_text(encoding="utf-8"))
