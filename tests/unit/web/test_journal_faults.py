"""Why a journal cannot be written is said in German, in its alarm and on the page, as the journal said it."""

import re
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest

from impactcell.alarms.rules import journal_fault
from impactcell.errors import JournalError
from impactcell.german.journal_faults import german_journal_fault
from impactcell.journal.database import errors, unreadable_state
from impactcell.journal.store import Journal
from impactcell.records import Alarm
from impactcell.scada import Role
from impactcell.web.interface import CellNews
from tests.snapshots import make_capture, make_snapshot
from tests.unit.web.page import CELL, make_page

ENGLISH = re.compile(
    r"\b(the|is|cannot|used|disk|file|journal of|damaged|begun|lost|another|room|not a|database)\b"
)


def failing(code: int, text: str) -> sqlite3.OperationalError:
    error = sqlite3.OperationalError(text)
    error.sqlite_errorcode, error.sqlite_errorname = code, "SQLITE_IOERR_WRITE"
    return error


def raised(path: Path, error: Exception) -> None:
    with errors(path):
        raise error


def foreign(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    Journal(path, CELL).close()


def of_format(path: Path, number: int) -> None:
    Journal(path, CELL).close()
    database = sqlite3.connect(path)
    database.execute(f"PRAGMA user_version = {number}")
    database.close()
    Journal(path, CELL)


def gone(path: Path, *, replaced: bool) -> None:
    with Journal(path, CELL) as journal:
        path.rename(path.with_suffix(".before"))
        if replaced:
            path.write_bytes(b"")
        capture = make_capture()
        journal.append(capture, make_snapshot(capture), b"")


def twice(path: Path) -> None:
    with Journal(path, CELL):
        Journal(path, CELL)


def of_another_cell(path: Path) -> None:
    Journal(path, "other").close()
    Journal(path, CELL)


def unreadable(path: Path, why: str) -> None:
    raise unreadable_state(path, CELL, ValueError(why))


FAULTS: list[Callable[[Path], None]] = [
    lambda path: raised(path, failing(sqlite3.SQLITE_FULL, "database or disk is full")),
    lambda path: raised(path, failing(sqlite3.SQLITE_READONLY, "attempt to write a readonly database")),
    lambda path: raised(path, failing(sqlite3.SQLITE_CANTOPEN, "unable to open database file")),
    lambda path: raised(path, failing(sqlite3.SQLITE_BUSY, "database is locked")),
    lambda path: raised(path, failing(sqlite3.SQLITE_IOERR, "disk I/O error")),
    lambda path: raised(path, failing(sqlite3.SQLITE_CORRUPT, "database disk image is malformed")),
    lambda path: foreign(path, b"a text, and no short one" * 100),
    lambda path: foreign(path, b"SQLite format 3\0" + bytes(500)),
    lambda path: of_format(path, 99),
    lambda path: gone(path, replaced=False),
    lambda path: gone(path, replaced=True),
    twice,
    of_another_cell,
    lambda path: unreadable(path, "the state is of format 12, this version knows up to 10"),
]


@pytest.mark.parametrize("fault", FAULTS)
def test_what_a_journal_says_has_its_german(tmp_path: Path, fault: Callable[[Path], None]) -> None:
    path = tmp_path / "press-1.sqlite"
    with pytest.raises(JournalError) as error:
        fault(path)
    said = german_journal_fault(str(error.value))
    assert said.startswith(str(path))
    assert not ENGLISH.search(said.removeprefix(str(path))), said


@pytest.mark.parametrize(
    ("reason", "german"),
    [
        ("/j.sqlite: the journal is begun anew", "/j.sqlite: das Journal wird neu begonnen"),
        (
            (
                "/j.sqlite: the table state is damaged: a checksum is wrong; the state of an "
                "earlier cycle is used instead"
            ),
            (
                "/j.sqlite: die Tabelle state ist beschädigt: eine Prüfsumme stimmt nicht; statt "
                "seiner gilt der Stand "
                "eines früheren Zyklus"
            ),
        ),
        (
            (
                "/j.sqlite: cannot be begun anew: /j.sqlite: cannot be used now ([Errno 13] "
                "Permission denied: '/j'); "
                "check its disk, directory and owner"
            ),
            (
                "/j.sqlite: kann nicht neu begonnen werden: /j.sqlite: derzeit nicht verwendbar "
                "(keine Berechtigung: "
                "'/j'); Datenträger, Verzeichnis und Besitzer prüfen"
            ),
        ),
        ("/j.sqlite: of a later day", "/j.sqlite: of a later day"),
    ],
)
def test_what_became_of_it_is_said_too(reason: str, german: str) -> None:
    assert german_journal_fault(reason) == german


async def test_the_alarm_and_the_system_page_say_it(tmp_path: Path) -> None:
    full = "/j.sqlite: the disk or its quota is full (database or disk is full); make room"
    message = journal_fault.result(full).message
    assert message is not None
    assert "Datenträger oder Kontingent sind voll (kein Platz); Platz schaffen. Die Zelle" in message.german
    alarm = Alarm(
        journal_fault.NAME, active=True, time_ns=1, message=message.english, message_de=message.german
    )
    page = make_page(tmp_path, tmp_path / "j.sqlite")
    page.feed.put(CellNews(CELL, alarms=(alarm,)))
    async with page.logged_in(Role.OBSERVER) as client:
        shown = {code: (await client.get(f"/system?lang={code}")).text for code in ("en", "de")}
    assert "Cycles cannot be stored: /j.sqlite: the disk" in shown["en"]
    assert "Zyklen können nicht gespeichert werden: /j.sqlite: Datenträger" in shown["de"]
