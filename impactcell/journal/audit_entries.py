"""What people did to a cell, as its journal keeps it."""

import sqlite3
from dataclasses import dataclass, fields

from impactcell.journal.checksums import CheckedTables


@dataclass(frozen=True, slots=True)
class AuditEntry:
    """Who did what, when, and what came of it."""

    time_ns: int
    user: str
    action: str
    arguments: str
    result: str


def stored_audit(db: sqlite3.Connection, tables: CheckedTables) -> tuple[AuditEntry, ...]:
    """Return every entry that is whole, oldest first."""
    rows = db.execute("SELECT * FROM audit ORDER BY id").fetchall()
    places = [tables.columns["audit"].index(field.name) for field in fields(AuditEntry)]
    return tuple(
        AuditEntry(*(row[place] for place in places)) for row in rows if tables.is_whole("audit", row)
    )
