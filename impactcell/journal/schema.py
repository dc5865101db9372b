"""Tables of a journal, and what of a cycle goes into which column.

One SQLite file a cell. `PRAGMA application_id` and `user_version` say that it is ours and of which
format. `cycles` grows by one row a cycle; `captures` holds what was measured, and is thinned first;
`state` is a single row, written in the same transaction as the cycle that made it; what an earlier version
wrote there is kept in `earlier_states`. State, alarms and model are stored as `stored_forms` says. `seq`
alone tells cycles apart: a module that keeps its session over a restart, or wraps its counter, makes the same
numbers again.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import cast

from impactcell.journal.checksums import CHECKED, SqlValue
from impactcell.quantities import BY_COLUMN, QUALITY_BY_COLUMN
from impactcell.records import Capture, Quality, Snapshot
from impactcell.records.quantity import DataType, Quantity

APPLICATION_ID = 0x49435243
"""`PRAGMA application_id` by which a file says that it is a journal: the letters ICRC."""
FORMAT = 6
"""From 4 on, state, alarms and model say of which format they are; from 5 on, rows have checksums, and these
cover from 6 on the numbers by which rows are in order."""
OLDEST = 3
"""Oldest format that can be read."""

Value = float | int | str


@dataclass(frozen=True, slots=True)
class Column:
    """A column of `cycles`: its name, SQL type, and where in a cycle its value is found."""

    name: str
    sql_type: str
    of: Callable[[Capture, Snapshot], Value]


_NOT_PUBLISHED: Mapping[str, Column] = {
    column.name: column
    for column in (
        Column("session", "INTEGER", lambda c, _: c.session),
        Column("cycle", "INTEGER", lambda c, _: c.cycle),
        Column("time_ns", "INTEGER", lambda c, _: c.time_ns),
        Column("velocity_m_s", "REAL", lambda c, _: c.velocity_m_s),
        Column("mass_kg", "REAL", lambda c, _: c.mass_kg),
        Column("direction", "INTEGER", lambda c, _: c.direction),
        Column("stroke_m", "REAL", lambda c, _: c.stroke_m),
        Column("dwell_s", "REAL", lambda c, _: c.dwell_s),
        Column("start_m", "REAL", lambda c, _: c.start_m),
        Column("mu_s_reason", "TEXT", lambda _, s: s.friction.mu_s.reason),
        Column("mu_k_reason", "TEXT", lambda _, s: s.friction.mu_k.reason),
        Column("by_force_reason", "TEXT", lambda _, s: s.friction.by_force.reason),
        Column("by_distance_reason", "TEXT", lambda _, s: s.friction.by_distance.reason),
        Column("combined", "REAL", lambda _, s: s.friction.combined.value),
        Column("combined_std", "REAL", lambda _, s: s.friction.combined.std),
        Column("combined_quality", "INTEGER", lambda _, s: int(s.friction.combined.quality)),
        Column("combined_reason", "TEXT", lambda _, s: s.friction.combined.reason),
        Column("estimator", "TEXT", lambda _, s: s.friction.estimator.value),
    )
}
"""Columns of what is kept of a cycle and not published; those of published quantities are in `quantities`."""

_ORDER = (
    *("session", "cycle", "time_ns", "velocity_m_s", "mass_kg", "direction", "stroke_m", "dwell_s"),
    *("start_m", "batch_id"),
    *("mu_s", "mu_s_std", "mu_s_quality", "mu_s_reason"),
    *("mu_k", "mu_k_std", "mu_k_quality", "mu_k_reason"),
    *("by_force", "by_force_std", "by_force_quality", "by_force_reason"),
    *("by_distance", "by_distance_std", "by_distance_quality", "by_distance_reason"),
    *("combined", "combined_std", "combined_quality", "combined_reason", "estimator"),
    *("peak_force_n", "sliding_distance_m"),
    *("wear_level", "wear_level_std", "wear_rate_per_cycle", "wear_quality", "cycles_to_limit"),
    *("batch_offset", "batch_offset_std", "batch_quality", "t_squared", "spe"),
    *("gap", "gap_quality", "model_name"),
)
"""Columns in the order that files have had since format 3; those of later quantities come after them."""

_SQL_TYPES = {
    DataType.DOUBLE: "REAL",
    DataType.UINT32: "INTEGER",
    DataType.STRING: "TEXT",
    DataType.BOOLEAN: "INTEGER",
}
"""How values are stored; a flag is 0 or 1."""


def _value(quantity: Quantity[Snapshot]) -> Callable[[Capture, Snapshot], Value]:
    read = cast("Callable[[Snapshot], Value]", quantity.value)
    return lambda _, snapshot: read(snapshot)


def _quality(quality: Callable[[Snapshot], Quality]) -> Callable[[Capture, Snapshot], Value]:
    return lambda _, snapshot: int(quality(snapshot))


def _columns() -> tuple[Column, ...]:
    columns = {
        **_NOT_PUBLISHED,
        **{n: Column(n, _SQL_TYPES[q.data_type], _value(q)) for n, q in BY_COLUMN.items()},
        **{n: Column(n, "INTEGER", _quality(q)) for n, q in QUALITY_BY_COLUMN.items()},
    }
    return tuple(columns[name] for name in dict.fromkeys((*_ORDER, *columns)))


COLUMNS = _columns()


def cycle_row(capture: Capture, snapshot: Snapshot) -> dict[str, SqlValue]:
    """Give the row of a cycle, as SQLite will give it back."""
    return {name: form(of(capture, snapshot)) for name, form, of in _CELLS}


def _real(value: Value) -> SqlValue:
    """NaN is no SQL number and stored as NULL; no number that SQLite gives back is a negative zero."""
    number = float(value)
    return None if math.isnan(number) else number + 0.0


_STORED_FORMS: Mapping[str, Callable[[Value], SqlValue]] = {"INTEGER": int, "REAL": _real, "TEXT": str}
"""What of a value is stored, by the SQL type of its column."""
_CELLS = tuple((column.name, _STORED_FORMS[column.sql_type], column.of) for column in COLUMNS)
"""The columns taken apart, for a row of every cycle."""


EARLIER_STATES = """
CREATE TABLE earlier_states (id INTEGER PRIMARY KEY, seq INTEGER NOT NULL, blob BLOB NOT NULL) STRICT
"""
"""States as earlier versions wrote them, from before they were written anew by a later one."""

STATE_BACKUP = """
CREATE TABLE state_backup (id INTEGER PRIMARY KEY CHECK (id = 1), blob BLOB NOT NULL, crc INTEGER) STRICT
"""
"""The state as it was some cycles ago, for the case that the newest is damaged."""

TABLES = f"""
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL, crc INTEGER) STRICT;
CREATE TABLE cycles (
    seq INTEGER PRIMARY KEY,
    {", ".join(f"{column.name} {column.sql_type}" for column in COLUMNS)},
    crc INTEGER
) STRICT;
CREATE INDEX cycles_by_time ON cycles (time_ns);
CREATE TABLE captures (seq INTEGER PRIMARY KEY, blob BLOB NOT NULL) STRICT;
CREATE TABLE alarms (
    id INTEGER PRIMARY KEY, time_ns INTEGER NOT NULL, record TEXT NOT NULL, crc INTEGER
) STRICT;
CREATE INDEX alarms_by_time ON alarms (time_ns);
CREATE TABLE audit (
    id INTEGER PRIMARY KEY, time_ns INTEGER NOT NULL, user TEXT NOT NULL,
    action TEXT NOT NULL, arguments TEXT NOT NULL, result TEXT NOT NULL, crc INTEGER
) STRICT;
CREATE TABLE state (
    id INTEGER PRIMARY KEY CHECK (id = 1), seq INTEGER NOT NULL, blob BLOB NOT NULL, crc INTEGER
) STRICT;
{STATE_BACKUP};
{EARLIER_STATES}"""

UPGRADES: Mapping[int, tuple[str, ...]] = {
    3: (EARLIER_STATES,),
    4: (STATE_BACKUP, *(f"ALTER TABLE {table} ADD COLUMN crc INTEGER" for table in CHECKED[:-1])),
    5: (),
}
"""Statements that lead from each earlier format to the next."""
