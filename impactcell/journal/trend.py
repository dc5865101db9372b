"""The past of a cell in as many columns as a chart has, at a cost that does not grow with the journal."""

import contextlib
import sqlite3
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from impactcell.errors import JournalError
from impactcell.journal.database import errors, open_database

CYCLES_PER_COLUMN: Final = 200
"""Cycles that are looked at in one column; of more, the first so many stand for all."""


@dataclass(frozen=True, slots=True)
class TrendColumn:
    """What the cycles of a stretch of time were; None where they have no such value.

    Attributes
    ----------
    time_ns : int
        Of its first cycle.
    cycles : int
        How many cycles were looked at.
    mu_s_low, mu_s_high : float or None
        Smallest and largest static friction.
    level, level_std : float or None
        Means of the tracked level and of its standard deviation.
    gap : float or None
        Largest gap between model and measurement.
    batch_id : str or None
        Batch of the last cycle.
    """

    time_ns: int
    cycles: int
    mu_s_low: float | None
    mu_s_high: float | None
    level: float | None
    level_std: float | None
    gap: float | None
    batch_id: str | None


_COLUMN: Final = """
SELECT min(time_ns), count(*), min(mu_s), max(mu_s), avg(wear_level), avg(wear_level_std), max(gap)
FROM (SELECT * FROM cycles WHERE time_ns >= ?1 AND time_ns < ?2 ORDER BY time_ns LIMIT ?3)
"""
_BATCH: Final = (
    "SELECT batch_id FROM cycles WHERE time_ns >= ?1 AND time_ns < ?2 ORDER BY time_ns DESC, seq DESC LIMIT 1"
)


def trend(path: Path, start_ns: int, end_ns: int, columns: int) -> tuple[TrendColumn, ...]:
    """Read the cycles from `start_ns` on, before `end_ns`, in equal stretches; empty ones are left out.

    Raises
    ------
    JournalError
        The journal cannot be read.
    """
    if not path.is_file():
        raise JournalError(f"{path}: there is no such journal")
    with errors(path), contextlib.closing(open_database(path, None, read_only=True)) as database:
        return _columns(database, start_ns, end_ns, columns)


def _columns(
    database: sqlite3.Connection, start_ns: int, end_ns: int, columns: int
) -> tuple[TrendColumn, ...]:
    first = database.execute("SELECT min(time_ns) FROM cycles WHERE time_ns >= ?", (start_ns,)).fetchone()[0]
    if first is None:
        return ()
    start_ns = max(start_ns, first)
    width_ns = max((end_ns - start_ns) // columns, 1)
    shown = []
    for begin_ns in range(start_ns, end_ns, width_ns):
        window = begin_ns, min(begin_ns + width_ns, end_ns)
        row = database.execute(_COLUMN, (*window, CYCLES_PER_COLUMN)).fetchone()
        if row[1]:
            row += database.execute(_BATCH, window).fetchone()
            shown.append(TrendColumn(*row))
    return tuple(shown)
