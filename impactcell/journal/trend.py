"""The past of a cell in as many columns as a chart has, at a cost that does not grow with the journal."""

import contextlib
import sqlite3
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any, Final

from impactcell.errors import JournalError
from impactcell.journal.checksums import CheckedTables
from impactcell.journal.database import errors, open_database

CYCLES_PER_COLUMN: Final = 60
"""Cycles that are read and checked in one column; of more, the first so many stand for all."""


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


Finished = dict[tuple[int, int], TrendColumn | None]
"""Columns that are over, by width and beginning in ns; None where there was no cycle."""

_CYCLES: Final = "SELECT * FROM cycles WHERE time_ns >= ? AND time_ns < ? ORDER BY time_ns, seq LIMIT ?"
_LAST: Final = (
    "SELECT * FROM cycles WHERE time_ns >= ? AND time_ns < ? ORDER BY time_ns DESC, seq DESC LIMIT 1"
)


def trend(
    path: Path, start_ns: int, end_ns: int, columns: int, finished: Finished | None = None
) -> tuple[TrendColumn, ...]:
    """Read the cycles from `start_ns` on, before `end_ns`, in equal stretches; empty ones are left out.

    Stretches begin at multiples of their width, and are halved as long as `columns` of them cover what there
    is. A row whose checksum is wrong is left out.

    Parameters
    ----------
    finished : dict, optional
        What was read before, and need not be read again; it is brought up to date.

    Raises
    ------
    JournalError
        The journal cannot be read.
    """
    if not path.is_file():
        raise JournalError(f"{path}: there is no such journal")
    with errors(path), contextlib.closing(open_database(path, None, read_only=True)) as database:
        reader = _Reader(database, path)
        first_ns = reader.first_ns(start_ns)
        if first_ns is None:
            return ()
        width_ns = max((end_ns - start_ns) // columns, 1)
        while width_ns > 1 and (width_ns // 2) * columns >= end_ns - first_ns:
            width_ns //= 2
        return _columns(reader, range(first_ns - first_ns % width_ns, end_ns, width_ns), end_ns, finished)


def _columns(
    reader: "_Reader", begins_ns: range, end_ns: int, finished: Finished | None
) -> tuple[TrendColumn, ...]:
    known: Finished = {} if finished is None else finished
    width_ns = begins_ns.step
    for old in [key for key in known if key[0] != width_ns or key[1] < begins_ns.start]:
        del known[old]
    shown = []
    for begin_ns in begins_ns:
        key = width_ns, begin_ns
        column = known[key] if key in known else reader.column(begin_ns, min(begin_ns + width_ns, end_ns))
        if begin_ns + 2 * width_ns <= end_ns:  # the clock of a module may be a little late
            known[key] = column
        if column is not None:
            shown.append(column)
    return tuple(shown)


class _Reader:
    def __init__(self, database: sqlite3.Connection, path: Path) -> None:
        self._database = database
        self._tables = CheckedTables(database, path)
        self._at = {name: i for i, name in enumerate(self._tables.columns["cycles"])}

    def first_ns(self, start_ns: int) -> int | None:
        """Find the first cycle from `start_ns` on."""
        query = "SELECT min(time_ns) FROM cycles WHERE time_ns >= ?"
        row: tuple[int | None] = self._database.execute(query, (start_ns,)).fetchone()
        return row[0]

    def column(self, begin_ns: int, end_ns: int) -> TrendColumn | None:
        """Read one stretch; None without a cycle in it."""
        rows = self._whole(_CYCLES, begin_ns, end_ns, CYCLES_PER_COLUMN)
        if not rows:
            return None
        last = self._whole(_LAST, begin_ns, end_ns) or rows[-1:]
        batch_id = last[0][self._at["batch_id"]]
        mu_s, gap = self._values(rows, "mu_s"), self._values(rows, "gap")
        level, level_std = self._values(rows, "wear_level"), self._values(rows, "wear_level_std")
        return TrendColumn(
            int(rows[0][self._at["time_ns"]]),
            len(rows),
            min(mu_s, default=None),
            max(mu_s, default=None),
            fmean(level) if level else None,
            fmean(level_std) if level_std else None,
            max(gap, default=None),
            None if batch_id is None else str(batch_id),
        )

    def _whole(self, query: str, *arguments: int) -> list[tuple[Any, ...]]:
        rows = self._database.execute(query, arguments).fetchall()
        return [row for row in rows if self._tables.is_whole("cycles", row)]

    def _values(self, rows: list[tuple[Any, ...]], column: str) -> list[float]:
        return [row[self._at[column]] for row in rows if row[self._at[column]] is not None]
