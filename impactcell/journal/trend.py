"""The past of a cell in as many columns as a chart has, at a cost that does not grow with the journal."""

import contextlib
import math
import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from statistics import fmean
from typing import Any, Final

from impactcell.alarms.rules import batch_shift
from impactcell.errors import JournalError
from impactcell.journal.checksums import CheckedTables
from impactcell.journal.database import errors, open_database
from impactcell.journal.stored_forms import load_alarms

CYCLES_PER_COLUMN: Final = 60
"""Cycles whose means stand for all of a column, spread evenly over it where there are more."""
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
        How many there are, without those that were found damaged.
    mu_s_low, mu_s_high : float or None
        Smallest and largest static friction of all of them.
    level, level_std : float or None
        Means of the tracked level and of its standard deviation, of `CYCLES_PER_COLUMN` at most.
    gap : float or None
        Largest gap between model and measurement of all of them.
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


@dataclass(slots=True)
class Finished:
    """What was read of a journal before, and stands as long as nothing of that time is added.

    Attributes
    ----------
    columns : dict
        Those that are over, by width and beginning in ns; None where there was no cycle.
    newest : int
        Number of the last row that they know of: rows with a later one may be of any time, for a module gives
        after an outage what its ring still holds, and clocks differ.
    """

    columns: dict[tuple[int, int], TrendColumn | None] = field(default_factory=dict)
    newest: int = 0


_COUNT: Final = "SELECT count(*) FROM cycles WHERE time_ns >= ? AND time_ns < ?"
_SPREAD: Final = (
    "SELECT cycles.* FROM (SELECT seq, row_number() OVER (ORDER BY time_ns, seq) AS place FROM cycles "
    "WHERE time_ns >= ? AND time_ns < ?) JOIN cycles USING (seq) WHERE (place - 1) % ? = 0 ORDER BY place"
)
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
    finished : Finished, optional
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
    width_ns = begins_ns.step
    known = _still_true(reader, begins_ns, finished or Finished())
    shown = []
    for begin_ns in begins_ns:
        key = width_ns, begin_ns
        column = known[key] if key in known else reader.column(begin_ns, min(begin_ns + width_ns, end_ns))
        if begin_ns + 2 * width_ns <= end_ns:  # what is added to the newest would be read again at once
            known[key] = column
        if column is not None:
            shown.append(column)
    return tuple(shown)


def _still_true(
    reader: "_Reader", begins_ns: range, finished: Finished
) -> dict[tuple[int, int], TrendColumn | None]:
    """Give the finished columns, without those that are not asked for or to which cycles were added."""
    known, width_ns = finished.columns, begins_ns.step
    for old in [key for key in known if key[0] != width_ns or key[1] < begins_ns.start]:
        del known[old]
    newest = reader.newest()  # before any column is read: a row that comes meanwhile is new next time
    if newest < finished.newest:
        known.clear()  # the journal was begun anew
    elif known:
        for begin_ns in reader.begins_after(finished.newest, width_ns):
            known.pop((width_ns, begin_ns), None)
    finished.newest = newest
    return known


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

    def newest(self) -> int:
        """Give the number of the last row."""
        row: tuple[int] = self._database.execute("SELECT coalesce(max(seq), 0) FROM cycles").fetchone()
        return row[0]

    def begins_after(self, seq: int, width_ns: int) -> list[int]:
        """Find in which stretches the rows after `seq` are."""
        query = "SELECT DISTINCT time_ns - time_ns % ? FROM cycles WHERE seq > ?"
        return [begin_ns for (begin_ns,) in self._database.execute(query, (width_ns, seq))]

    def column(self, begin_ns: int, end_ns: int) -> TrendColumn | None:
        """Read one stretch; None without a cycle in it."""
        stretch = begin_ns, end_ns
        count: int = self._database.execute(_COUNT, stretch).fetchone()[0]
        damaged = set[int]()
        rows = self._whole(damaged, _SPREAD, *stretch, -(-count // CYCLES_PER_COLUMN)) if count else []
        if not rows:
            return None
        last = self._whole(damaged, _LAST, *stretch) or rows[-1:]
        batch_id = last[0][self._at["batch_id"]]
        level, level_std = self._values(rows, "wear_level"), self._values(rows, "wear_level_std")
        low, high, gap = (
            self._extreme(damaged, extreme, *stretch) for extreme in ("min(mu_s)", "max(mu_s)", "max(gap)")
        )
        return TrendColumn(
            int(rows[0][self._at["time_ns"]]),
            count - len(damaged),
            low,
            high,
            fmean(level) if level else None,
            fmean(level_std) if level_std else None,
            gap,
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

    def _extreme(self, damaged: set[int], extreme: str, begin_ns: int, end_ns: int) -> float | None:
        """Find the smallest or largest value of a stretch that stands in a whole row; None without one."""
        while True:
            # SQLite takes the other columns from the row in which it found the extreme.
            query = (
                f"SELECT *, {extreme} FROM cycles WHERE time_ns >= ? AND time_ns < ? "  # noqa: S608 - ours
                f"AND seq NOT IN ({', '.join(map(str, damaged))})"
            )
            row = self._database.execute(query, (begin_ns, end_ns)).fetchone()
            value: float | None = row[-1]
            if value is None or self._tables.is_whole("cycles", row[:-1]):
                return value
            damaged.add(row[self._at["seq"]])

    def _whole(self, damaged: set[int], query: str, *arguments: int) -> list[tuple[Any, ...]]:
        whole = []
        for row in self._database.execute(query, arguments):
            if self._tables.is_whole("cycles", row):
                whole.append(row)
            else:
                damaged.add(row[self._at["seq"]])
        return whole

    def _values(self, rows: list[tuple[Any, ...]], column: str) -> list[float]:
        return [row[self._at[column]] for row in rows if row[self._at[column]] is not None]
