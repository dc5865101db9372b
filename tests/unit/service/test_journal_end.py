"""What a journal's files are after the end of the service."""

import contextlib
import sqlite3
from pathlib import Path

import pytest

from impactcell.journal.retention import Retention
from impactcell.journal.store import Journal
from impactcell.service.journal_writer import JournalWriter


@pytest.mark.parametrize("is_held", [True, False], ids=["held open by another program", "by nobody else"])
def test_a_log_that_cannot_be_emptied_at_the_end_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, is_held: bool
) -> None:
    """As on a full disk: what is stored is then in two files."""
    writer = JournalWriter("cell-1", Journal(tmp_path / "j.sqlite", "cell-1"), Retention())
    writer.store_model("model")
    with contextlib.closing(sqlite3.connect(tmp_path / "j.sqlite")) as other:
        if is_held:
            other.execute("SELECT count(*) FROM meta").fetchone()
        writer.close()
        told = [record.getMessage() for record in caplog.records]
        assert (tmp_path / "j.sqlite-wal").exists() == is_held == bool(told)
        assert all("copy j.sqlite and j.sqlite-wal together" in text for text in told)
