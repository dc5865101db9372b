"""One writer a journal, under whatever name; and what an error of the file system is called."""

import os
import sqlite3
from pathlib import Path

import pytest

from impactcell.errors import ForeignJournalError, JournalError, JournalFullError, JournalUnavailableError
from impactcell.german.journal_faults import german_journal_fault
from impactcell.journal.database import errors
from impactcell.journal.refusal import refusal
from impactcell.journal.store import Journal


def test_a_second_writer_is_refused(tmp_path: Path) -> None:
    with Journal(tmp_path / "j", "c"), pytest.raises(JournalError, match="another service writes"):
        Journal(tmp_path / "j", "c")


def test_a_lock_that_is_removed_lets_no_second_writer_in(tmp_path: Path) -> None:
    """One that nobody else has taken is taken again."""
    lock = tmp_path / "j.lock"
    with Journal(tmp_path / "j", "c") as journal:
        lock.unlink()
        journal.store_model("one")
        assert lock.exists()
        with pytest.raises(JournalError, match="to remove its lock does not help"):
            Journal(tmp_path / "j", "c")
        lock.unlink()
        with Journal(tmp_path / "j", "c") as second:
            with pytest.raises(
                JournalUnavailableError, match="its lock was removed; end one of them"
            ) as told:
                journal.store_model("two")
            assert second.model == "one"
            second.store_model("three")
        journal.store_model("four")
        assert journal.model == "four"
    _, fault = str(told.value).split(": ", 1)
    assert german_journal_fault(f"{tmp_path / 'j'}: {fault}").endswith("einen der beiden beenden")


def test_a_second_writer_by_a_symbolic_link_is_refused(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    link = tmp_path / "elsewhere" / "link"
    link.symlink_to(tmp_path / "j")
    with Journal(tmp_path / "j", "c"), pytest.raises(JournalError, match="another service writes"):
        Journal(link, "c")
    with Journal(link, "c"), pytest.raises(JournalError, match="another service writes"):
        Journal(tmp_path / "j", "c")


def test_a_file_with_a_second_name_is_refused_under_both(tmp_path: Path) -> None:
    path, other = tmp_path / "j", tmp_path / "other"
    with Journal(path, "c"):
        os.link(path, other)
        with pytest.raises(JournalError, match=r"has another name as well \(a hard link\)") as told:
            Journal(other, "c")
        assert not told.value.retry
    with pytest.raises(JournalError, match="hard link"):
        Journal(path, "c")
    with Journal(other, "c", read_only=True) as journal:
        assert journal.cell == "c"
    other.unlink()
    Journal(path, "c").close()


def test_no_lock_is_begun_beside_what_is_no_journal(tmp_path: Path) -> None:
    path = tmp_path / "users.yaml"
    path.write_text("users: []\n")
    with pytest.raises(
        ForeignJournalError, match="not even a database; it is left as it is; name another file"
    ):
        Journal(path, "c")
    assert [file.name for file in tmp_path.iterdir()] == ["users.yaml"]
    assert path.read_text() == "users: []\n"


@pytest.mark.parametrize("content", [b"", None])
def test_a_file_that_can_become_a_journal_is_not_refused(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "j"
    if content is not None:
        path.write_bytes(content)
    assert refusal(path, "c") == ""
    assert path.exists() == (content is not None)


def test_what_a_service_would_refuse_is_refused_and_left(tmp_path: Path) -> None:
    path, other = tmp_path / "j", tmp_path / "other"
    with Journal(path, "c"):
        pass
    assert refusal(path, "c") == ""
    assert refusal(path, "d").endswith("the journal of cell 'c', not of 'd'; name another file")
    os.link(path, other)
    assert "has another name as well (a hard link)" in refusal(path, "c")
    theirs = tmp_path / "theirs"
    with sqlite3.connect(theirs) as database:
        database.execute("CREATE TABLE theirs (x)")
    database.close()
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    assert "a database, but no journal of impactcell" in refusal(theirs, "c")
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_a_damaged_journal_is_not_refused_for_it_is_put_aside(tmp_path: Path) -> None:
    path = tmp_path / "j"
    Journal(path, "c").close()
    whole = path.read_bytes()
    path.write_bytes(whole[:100] + b"\xff" * (len(whole) - 100))
    assert refusal(path, "c") == ""


def sqlite_error(code: int, name: str, text: str) -> sqlite3.OperationalError:
    error = sqlite3.OperationalError(text)
    error.sqlite_errorcode, error.sqlite_errorname = code, name
    return error


def test_a_disk_that_fails_is_not_called_full(tmp_path: Path) -> None:
    failed = sqlite_error(sqlite3.SQLITE_IOERR_FSYNC, "SQLITE_IOERR_FSYNC", "disk I/O error")
    with pytest.raises(JournalUnavailableError, match="SQLITE_IOERR_FSYNC") as told, errors(tmp_path / "j"):
        raise failed
    assert not isinstance(told.value, JournalFullError)
    assert told.value.retry
    assert "though it is not full" in str(told.value)


def test_a_disk_that_fails_and_is_full_is_called_full(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    full = os.statvfs_result((4096, 4096, 1000, 0, 0, 10, 10, 10, 0, 255))
    monkeypatch.setattr(os, "statvfs", lambda _: full)
    failed = sqlite_error(sqlite3.SQLITE_IOERR_WRITE, "SQLITE_IOERR_WRITE", "disk I/O error")
    with pytest.raises(JournalFullError, match="make room"), errors(tmp_path / "j"):
        raise failed


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (sqlite3.SQLITE_BUSY, "close it there"),
        (sqlite3.SQLITE_BUSY_SNAPSHOT, "close it there"),
        (sqlite3.SQLITE_LOCKED, "close it there"),
        (sqlite3.SQLITE_CANTOPEN, "cannot be used now"),
        (sqlite3.SQLITE_READONLY, "cannot be used now"),
    ],
)
def test_what_cannot_be_used_now_is_not_called_full(tmp_path: Path, code: int, words: str) -> None:
    with pytest.raises(JournalUnavailableError, match=words) as told, errors(tmp_path / "j"):
        raise sqlite_error(code, "", "no")
    assert not isinstance(told.value, JournalFullError)


def test_a_directory_that_is_not_there_is_not_called_a_full_disk(tmp_path: Path) -> None:
    with pytest.raises(JournalUnavailableError) as told:
        Journal(tmp_path / "nowhere" / "j", "c")
    assert not isinstance(told.value, JournalFullError)


@pytest.mark.parametrize("suffix", ["", "-wal", "-shm"])
def test_a_file_that_may_only_be_read_is_not_opened_for_writing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    """SQLite would open it, as of another owner, and no cycle be stored once its owner was set right."""
    path, kept = tmp_path / "j", []
    Journal(path, "c").close()
    read_only = path.with_name(path.name + suffix)
    read_only.touch()
    access = os.access

    def may(file: Path, mode: int) -> bool:  # who runs this may be root, who may do everything
        return access(file, mode) and not (file == read_only and mode & os.W_OK and not kept)

    monkeypatch.setattr(os, "access", may)
    with pytest.raises(JournalUnavailableError) as told:
        Journal(path, "c")
    reason = f"{read_only.name}: Permission denied"
    assert str(told.value) == f"{path}: cannot be used now ({reason}); check its disk, directory and owner"
    kept.append("its owner was set right")
    Journal(path, "c").close()
