"""The past of a cell in as many columns as a chart has, at a cost that does not grow with the journal."""

import contextlib
import math
import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any, Final

from impactcell.alarms.rules import batch_shift
from impactcell.errors import JournalError
from impactcell.journal.checksums import CheckedTables
from impactcell.journal.database import errors, open_database
from impactcell.journal.stored_forms import load_alarms

CYCLES_PER_COLUMN: Final = 60
"""Cycles that are read and checked in one column; of more, the first so many stand for all."""
SHIFTS: Final = 200
"""Transitions of the alarm of a batch shift that are looked at, the newest: more marks than a chart shows."""
LOOKED_BACK: Final = 5000
"""Cycles before the alarm among which the first after the change is looked for: it is seldom far."""


@dataclass(frozen=True, slots=True)
class Shift:
    """A change of the material that the tracker found.

    Attributes
    ----------
    time_ns : int
        Of the first cycle after it; of the alarm, where the journal does not have that cycle any more.
    cycle : int
        That cycle.
    size, size_std : float
        By how much friction is higher since.
    """

    time_ns: int
    cycle: int
    size: float
    size_std: float


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
_SHIFTS: Final = (
    "SELECT * FROM alarms WHERE time_ns >= ? AND time_ns < ? AND instr(record, ?) "
    "ORDER BY time_ns DESC, id DESC LIMIT ?"
)
_CYCLE_BEFORE: Final = (
    "SELECT time_ns FROM (SELECT cycle, time_ns FROM cycles WHERE time_ns <= ? "
    "ORDER BY time_ns DESC, seq DESC LIMIT ?) WHERE cycle = ? LIMIT 1"
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
    with _reading(path) as reader:
        first_ns = reader.first_ns(start_ns)
        if first_ns is None:
            return ()
        width_ns = max((end_ns - start_ns) // columns, 1)
        while width_ns > 1 and (width_ns // 2) * columns >= end_ns - first_ns:
            width_ns //= 2
        return _columns(reader, range(first_ns - first_ns % width_ns, end_ns, width_ns), end_ns, finished)


def shifts(path: Path, start_ns: int, end_ns: int) -> tuple[Shift, ...]:
    """Read the changes of the material that were found from `start_ns` on, before `end_ns`, in their order.

    They are those of the alarm, whatever became of it since; a batch that was named is in the columns.

    Raises
    ------
    JournalError
        The journal cannot be read.
    """
    with _reading(path) as reader:
        return reader.shifts(start_ns, end_ns)


@contextlib.contextmanager
def _reading(path: Path) -> Iterator["_Reader"]:
    if not path.is_file():
        raise JournalError(f"{path}: there is no such journal")
    with errors(path), contextlib.closing(open_database(path, None, read_only=True)) as database:
        yield _Reader(database, path)


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

    def shifts(self, start_ns: int, end_ns: int) -> tuple[Shift, ...]:
        """Read the changes that the alarm of a batch shift told, each once."""
        named = f'"{batch_shift.NAME}"'
        rows = self._database.execute(_SHIFTS, (start_ns, end_ns, named, SHIFTS)).fetchall()
        at = self._tables.columns["alarms"].index("record")
        records = [str(row[at]) for row in rows if self._tables.is_whole("alarms", row)]
        found: dict[tuple[int, int], Shift] = {}
        for alarm in load_alarms(records):
            evidence = alarm.evidence
            key = alarm.activation, evidence.change_cycle
            if alarm.name != batch_shift.NAME or not math.isfinite(evidence.size) or key in found:
                continue
            told_ns = alarm.activation or alarm.time_ns  # what is done to it later has a later time
            before = self._database.execute(
                _CYCLE_BEFORE, (told_ns, LOOKED_BACK, evidence.change_cycle)
            ).fetchone()
            time_ns = told_ns if before is None else int(before[0])
            if time_ns >= start_ns:
                found[key] = Shift(time_ns, evidence.change_cycle, evidence.size, evidence.size_std)
        return tuple(sorted(found.values(), key=lambda shift: shift.time_ns))

    def _whole(self, query: str, *arguments: int) -> list[tuple[Any, ...]]:
        rows = self._database.execute(query, arguments).fetchall()
        return [row for row in rows if self._tables.is_whole("cycles", row)]

    def _values(self, rows: list[tuple[Any, ...]], column: str) -> list[float]:
        return [row[self._at[column]] for row in rows if row[self._at[column]] is not None]
