"""Tables of a journal, and which figure of a snapshot goes into which column.

One SQLite file a cell. `PRAGMA application_id` and `user_version` say that it is ours and of which
format. `cycles` grows by one row a cycle; `captures` holds what was measured, and is thinned first;
`state` is a single row, written in the same transaction as the cycle that made it; what an earlier version
wrote there is kept in `earlier_states`. State, alarms and model are stored as `stored_forms` says. `seq`
alone tells cycles apart: a module that keeps its session over a restart, or wraps its counter, makes the same
numbers again.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from impactcell.records import Capture, Coefficient, Snapshot

APPLICATION_ID = 0x49435243  # "ICRC"
FORMAT = 4
"""From 4 on, state, alarms and model say of which format they are."""
OLDEST = 3
"""Oldest format that can be read."""

Value = float | int | str


@dataclass(frozen=True, slots=True)
class Column:
    """A column of `cycles`: its name, SQL type, and where in a cycle its value is found."""

    name: str
    sql_type: str
    of: Callable[[Capture, Snapshot], Value]


def _coefficient(name: str, of: Callable[[Snapshot], Coefficient]) -> tuple[Column, ...]:
    return (
        Column(name, "REAL", lambda _, s: of(s).value),
        Column(f"{name}_std", "REAL", lambda _, s: of(s).std),
        Column(f"{name}_quality", "INTEGER", lambda _, s: int(of(s).quality)),
        Column(f"{name}_reason", "TEXT", lambda _, s: of(s).reason),
    )


COLUMNS: tuple[Column, ...] = (
    Column("session", "INTEGER", lambda c, _: c.session),
    Column("cycle", "INTEGER", lambda c, _: c.cycle),
    Column("time_ns", "INTEGER", lambda c, _: c.time_ns),
    Column("velocity_m_s", "REAL", lambda c, _: c.velocity_m_s),
    Column("mass_kg", "REAL", lambda c, _: c.mass_kg),
    Column("direction", "INTEGER", lambda c, _: c.direction),
    Column("stroke_m", "REAL", lambda c, _: c.stroke_m),
    Column("dwell_s", "REAL", lambda c, _: c.dwell_s),
    Column("start_m", "REAL", lambda c, _: c.start_m),
    Column("batch_id", "TEXT", lambda _, s: s.batch.batch_id),
    *_coefficient("mu_s", lambda s: s.friction.mu_s),
    *_coefficient("mu_k", lambda s: s.friction.mu_k),
    *_coefficient("by_force", lambda s: s.friction.by_force),
    *_coefficient("by_distance", lambda s: s.friction.by_distance),
    *_coefficient("combined", lambda s: s.friction.combined),
    Column("estimator", "TEXT", lambda _, s: s.friction.estimator.value),
    Column("peak_force_n", "REAL", lambda _, s: s.friction.peak_force_n),
    Column("sliding_distance_m", "REAL", lambda _, s: s.friction.sliding_distance_m),
    Column("wear_level", "REAL", lambda _, s: s.wear.level),
    Column("wear_level_std", "REAL", lambda _, s: s.wear.level_std),
    Column("wear_rate_per_cycle", "REAL", lambda _, s: s.wear.rate_per_cycle),
    Column("wear_quality", "INTEGER", lambda _, s: int(s.wear.quality)),
    Column("cycles_to_limit", "REAL", lambda _, s: s.wear.cycles_to_limit),
    Column("batch_offset", "REAL", lambda _, s: s.batch.offset),
    Column("batch_offset_std", "REAL", lambda _, s: s.batch.offset_std),
    Column("batch_quality", "INTEGER", lambda _, s: int(s.batch.quality)),
    Column("t_squared", "REAL", lambda _, s: s.signature.t_squared),
    Column("spe", "REAL", lambda _, s: s.signature.spe),
    Column("gap", "REAL", lambda _, s: s.gap),
    Column("gap_quality", "INTEGER", lambda _, s: int(s.gap_quality)),
    Column("model_name", "TEXT", lambda _, s: s.model_name),
)

EARLIER_STATES = """
CREATE TABLE earlier_states (id INTEGER PRIMARY KEY, seq INTEGER NOT NULL, blob BLOB NOT NULL) STRICT
"""
"""States as earlier versions wrote them, from before they were written anew by a later one."""

TABLES = f"""
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT;
CREATE TABLE cycles (
    seq INTEGER PRIMARY KEY,
    {", ".join(f"{column.name} {column.sql_type}" for column in COLUMNS)}
) STRICT;
CREATE INDEX cycles_by_time ON cycles (time_ns);
CREATE TABLE captures (seq INTEGER PRIMARY KEY, blob BLOB NOT NULL) STRICT;
CREATE TABLE alarms (id INTEGER PRIMARY KEY, time_ns INTEGER NOT NULL, record TEXT NOT NULL) STRICT;
CREATE INDEX alarms_by_time ON alarms (time_ns);
CREATE TABLE audit (
    id INTEGER PRIMARY KEY, time_ns INTEGER NOT NULL, user TEXT NOT NULL,
    action TEXT NOT NULL, arguments TEXT NOT NULL, result TEXT NOT NULL
) STRICT;
CREATE TABLE state (id INTEGER PRIMARY KEY CHECK (id = 1), seq INTEGER NOT NULL, blob BLOB NOT NULL) STRICT;
{EARLIER_STATES}"""

UPGRADES: Mapping[int, tuple[str, ...]] = {3: (EARLIER_STATES,)}
"""Statements that lead from each earlier format to the next."""
