"""A checksum for every row, so that a bit that has changed on the disk is not believed.

SQLite checks the structure of its pages, not what stands in them. Each row that is written carries the CRC-32
of its values in the order of the table's columns, and of its number where rows stand in the order of these;
one without, from an older format, is taken as it is. A column that is added later is NULL in the rows before,
and so does not change their checksums.
"""

import logging
import sqlite3
import zlib
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final

import msgspec

from impactcell.errors import JournalDamagedError

log = logging.getLogger(__name__)

CHECKED: Final = ("meta", "cycles", "alarms", "audit", "state", "state_backup")
"""Tables whose rows have a column `crc`; a capture carries its checksum inside."""
KEYS: Final = ("seq", "id", "crc")
"""Columns that are no values: the number of a row, and the checksum."""
NUMBERED: Final = {"cycles": "seq", "alarms": "id", "audit": "id"}
"""Tables whose rows stand in the order of their numbers, with the column of these. From format 6 on checksums
cover the number too: a changed bit in it would put a row, as it was, in the place of another."""

SqlValue = float | int | str | bytes | None
_ENCODER = msgspec.msgpack.Encoder()


def row_crc(values: Sequence[SqlValue], number: SqlValue = None) -> int:
    """CRC-32 of a row, without `KEYS`, as read back, and of its number; NULL at the end does not count."""
    end = len(values)
    while end and values[end - 1] is None:
        end -= 1
    crc = zlib.crc32(_ENCODER.encode(values[:end]))
    return crc if number is None else zlib.crc32(_ENCODER.encode(number), crc)


@cache
def _insert(table: str, columns: tuple[str, ...]) -> str:
    """Give the statement that writes a row of these columns and its checksum."""
    names, places = ", ".join((*columns, "crc")), ", ".join("?" * (len(columns) + 1))
    return f"INSERT OR REPLACE INTO {table} ({names}) VALUES ({places})"  # noqa: S608 - from CHECKED


class CheckedTables:
    """The tables of an open journal whose rows have checksums."""

    def __init__(self, database: sqlite3.Connection, path: Path) -> None:
        self._database = database
        self._path = path
        self._told: set[tuple[str, int]] = set()
        self.columns = {
            table: tuple(name for _, name, *_ in database.execute(f"PRAGMA table_info ({table})"))
            for table in CHECKED
        }
        """All columns of each table, in its own order."""
        self._covered = {
            table: [i for i, name in enumerate(columns) if name not in KEYS]
            for table, columns in self.columns.items()
        }
        self._crc_at = {
            table: columns.index("crc") if "crc" in columns else None
            for table, columns in self.columns.items()
        }
        self._number_at = {
            table: self.columns[table].index(key)
            for table, key in NUMBERED.items()
            if key in self.columns[table]
        }

    def insert(self, table: str, values: Mapping[str, SqlValue]) -> int | None:
        """Write a row with its checksum, in the place of one with the same key; returns its number."""
        number = None
        if table in NUMBERED:
            number = self._next_number(table)
            values = {**values, NUMBERED[table]: number}
        columns = self.columns[table]
        crc = row_crc([values.get(columns[i]) for i in self._covered[table]], number)
        return self._database.execute(_insert(table, tuple(values)), [*values.values(), crc]).lastrowid

    def rows(self, table: str, query: str, *arguments: str) -> list[dict[str, Any]]:
        """Read whole rows that have to be right.

        Raises
        ------
        JournalDamagedError
            If one is not as it was written.
        """
        rows = self._database.execute(query, arguments).fetchall()
        if not all(self._fits(table, row) for row in rows):
            raise JournalDamagedError(f"{self._path}: the table {table} is damaged: a checksum is wrong")
        return [dict(zip(self.columns[table], row, strict=True)) for row in rows]

    def is_whole(self, table: str, row: Sequence[SqlValue]) -> bool:
        """Whether a row is as it was written; of one that is not it is told once."""
        if self._fits(table, row):
            return True
        number = row[0] if isinstance(row[0], int) else 0
        if (table, number) not in self._told:
            self._told.add((table, number))
            log.error("%s: row %d of %s is damaged and left out", self._path, number, table)
        return False

    def _fits(self, table: str, row: Sequence[SqlValue]) -> bool:
        at = self._crc_at[table]
        if at is None or row[at] is None:
            return True
        values = [row[i] for i in self._covered[table]]
        if table in self._number_at and row[at] == row_crc(values, row[self._number_at[table]]):
            return True
        return row[at] == row_crc(values)

    def _next_number(self, table: str) -> int:
        last = f"SELECT coalesce(max({NUMBERED[table]}), 0) FROM {table}"  # noqa: S608 - from NUMBERED
        return int(self._database.execute(last).fetchone()[0]) + 1
