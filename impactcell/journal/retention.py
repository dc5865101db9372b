"""How long a journal keeps what: by age and by size; captures go before summaries.

Where room is needed, transitions of alarms and actions of people that take more than `SHARE` of the size go
first, down to that: an alarm that comes and goes all night must not push out what was measured. Captures are
next, and cycles last, each with the alarms that are older than the oldest cycle that is left. What tells how
an alarm that is active came is never dropped, and actions of people go for nothing else than their age and
their share.
"""

import sqlite3
from collections.abc import Collection
from dataclasses import dataclass

_CHUNK = 64
"""Rows dropped at a time when room is needed: a few megabytes of captures."""
SHARE = 0.1
"""Share of the size that transitions of alarms may take, and actions of people as well."""
ROW_BYTES = 1024
"""What one of them takes, about: an alarm has its message in two languages."""
_ROWS = 1024
"""Of these, dropped at a time: about as many bytes as `_CHUNK` captures."""
NS_PER_DAY = 86_400 * 10**9
"""Nanoseconds of a day."""
SETTLED_NS = NS_PER_DAY // 4
"""So long cycles have to come by a clock that has leapt, before their time makes others old."""
PRUNE_LIMIT = 512
"""Captures, and cycles, dropped at once: after a long rest, or with a shorter retention, gigabytes may have
to go, and neither a cycle nor the end of the service is to wait for that."""
FREE_SHARE = 0.05
"""Share of the size that is left free, for what comes until thinning is due again."""


@dataclass(frozen=True, slots=True)
class Retention:
    """What is kept.

    Attributes
    ----------
    days, captures_days : float
        Cycles, and captures, older than this are dropped. One without a time (0, from a module whose clock is
        not set) is of unknown age, and goes only when its room is needed. What a clock that was behind has
        dated goes after all that was stored before it.
    max_size_bytes : int
        When less than `FREE_SHARE` of it is left, room is made, oldest first: of alarms and actions beyond
        their `SHARE`, of captures, then of cycles with their alarms.
    """

    days: float = 365.0
    captures_days: float = 30.0
    max_size_bytes: int = 4096 * 2**20


def borne_out_ns(database: sqlite3.Connection, now_ns: int) -> int:
    """Give the latest time up to `now_ns` that the cycles bear out: no later than a day after one of them.

    Only those count that are older than `SETTLED_NS`. So a clock that is ahead for a while, as a computer's
    until it is set from the network, makes nothing old; after a month in which the machine stood, the first
    hours make nothing old either.
    """
    query = "SELECT max(time_ns) FROM cycles WHERE time_ns > 0 AND time_ns <= ?"
    (newest_ns,) = database.execute(query, (now_ns - SETTLED_NS,)).fetchone()
    return now_ns if newest_ns is None else min(now_ns, newest_ns + SETTLED_NS + NS_PER_DAY)


def prune(
    database: sqlite3.Connection, keep: Retention, now_ns: int, active_ns: Collection[int] = ()
) -> bool:
    """Drop what `keep` does not keep, and give the space back; the last cycle always stays.

    Called inside no transaction; each step commits by itself, so a crash in between loses nothing else.

    Parameters
    ----------
    active_ns : collection of int
        Times of transitions of alarms that are active, which stay.

    Returns
    -------
    bool
        Whether there may be more to drop; a call drops no more than `PRUNE_LIMIT` for each reason.
    """
    oldest_ns = now_ns - int(keep.days * NS_PER_DAY)
    oldest_capture_ns = now_ns - int(min(keep.captures_days, keep.days) * NS_PER_DAY)
    captures = database.execute(
        "DELETE FROM captures WHERE seq IN (SELECT seq FROM cycles WHERE time_ns > 0 AND time_ns < ? "
        "AND seq < ? AND EXISTS (SELECT 1 FROM captures WHERE captures.seq = cycles.seq) "
        "ORDER BY time_ns LIMIT ?)",
        (oldest_capture_ns, _first_young(database, "captures", oldest_capture_ns, now_ns), PRUNE_LIMIT),
    )
    cycles = database.execute(
        "DELETE FROM cycles WHERE seq IN (SELECT seq FROM cycles WHERE time_ns > 0 AND time_ns < ? "
        "AND seq < ? AND seq < (SELECT max(seq) FROM cycles) ORDER BY time_ns LIMIT ?)",
        (oldest_ns, _first_young(database, "cycles", oldest_ns, now_ns), PRUNE_LIMIT),
    )
    more = PRUNE_LIMIT in (captures.rowcount, cycles.rowcount)
    over = f"time_ns NOT IN ({', '.join(map(str, active_ns))})"
    database.execute(
        f"DELETE FROM alarms WHERE time_ns > 0 AND time_ns < ?1 AND {over} "  # noqa: S608 - from above
        "AND time_ns NOT IN (SELECT time_ns FROM cycles WHERE time_ns < ?1)",
        (oldest_ns,),
    )
    database.execute("DELETE FROM audit WHERE time_ns < ?", (oldest_ns,))
    for _ in range(PRUNE_LIMIT // _CHUNK):
        if _size(database) <= (1.0 - FREE_SHARE) * keep.max_size_bytes:
            break
        if not _drop_oldest(database, int(SHARE * keep.max_size_bytes) // ROW_BYTES, over):
            break
    else:
        more = True
    # execute() steps this statement once and gives back a single page; executescript() runs it to its end.
    database.executescript("PRAGMA incremental_vacuum")
    database.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchall()
    return more


def _first_young(database: sqlite3.Connection, table: str, oldest_ns: int, now_ns: int) -> int:
    """Give the number of the first cycle of `table` that is not old; without any, one after the last.

    Nothing behind it is old, whatever its time says: it was stored later, by a clock that was behind. A time
    after `now_ns` tells nothing of age.
    """
    query = (
        f"SELECT seq FROM cycles NOT INDEXED WHERE seq >= (SELECT min(seq) FROM {table}) "  # noqa: S608 - ours
        "AND time_ns BETWEEN ? AND ? ORDER BY seq LIMIT 1"
    )  # from the oldest on: by time it would have to look at all that are young
    row = database.execute(query, (oldest_ns, now_ns)).fetchone()
    if row is None:
        row = database.execute("SELECT coalesce(max(seq), 0) + 1 FROM cycles").fetchone()
    return int(row[0])


def _drop_oldest(database: sqlite3.Connection, most: int, over: str) -> bool:
    """Drop a few of what has to go first; False when nothing is left that may.

    Parameters
    ----------
    most : int
        Alarms, and actions, that may be kept.
    over : str
        Condition of the alarms that may be dropped.
    """
    if _drop_rows(database, "alarms", most, over) or _drop_rows(database, "audit", most, "TRUE"):
        return True
    captures = database.execute(
        "DELETE FROM captures WHERE seq IN (SELECT seq FROM captures ORDER BY seq LIMIT ?)", (_CHUNK,)
    )
    if captures.rowcount > 0:
        return True
    cycles = database.execute(
        "DELETE FROM cycles WHERE seq IN "
        "(SELECT seq FROM cycles WHERE seq < (SELECT max(seq) FROM cycles) ORDER BY seq LIMIT ?)",
        (_CHUNK,),
    )
    database.execute(
        "DELETE FROM alarms WHERE time_ns > 0 AND time_ns < "  # noqa: S608 - from above
        f"(SELECT min(time_ns) FROM cycles WHERE time_ns > 0) AND {over}"
    )
    return cycles.rowcount > 0


def _drop_rows(database: sqlite3.Connection, table: str, most: int, condition: str) -> bool:
    """Drop some of the oldest rows where there are more than `most`; says whether there were any."""
    (count,) = database.execute(f"SELECT count(*) FROM {table}").fetchone()  # noqa: S608 - ours
    dropped = database.execute(
        f"DELETE FROM {table} WHERE id IN "  # noqa: S608 - ours
        f"(SELECT id FROM {table} WHERE {condition} ORDER BY id LIMIT ?)",
        (min(max(count - most, 0), _ROWS),),
    )
    return dropped.rowcount > 0


def _size(database: sqlite3.Connection) -> int:
    """Bytes in use, free pages not counted."""
    (pages,) = database.execute("PRAGMA page_count").fetchone()
    (free,) = database.execute("PRAGMA freelist_count").fetchone()
    (page_size,) = database.execute("PRAGMA page_size").fetchone()
    return int((pages - free) * page_size)
