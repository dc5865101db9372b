"""How long a journal keeps what: by age and by size; captures go before summaries."""

import sqlite3
from dataclasses import dataclass

_CHUNK = 64
"""Rows dropped at a time when room is needed: a few megabytes of captures."""
_NS_PER_DAY = 86_400 * 10**9
"""Nanoseconds of a day."""
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
        not set) is of unknown age, and goes only when its room is needed.
    max_size_bytes : int
        When less than `FREE_SHARE` of it is left, captures are dropped oldest first, then cycles with their
        alarms.
    """

    days: float = 365.0
    captures_days: float = 30.0
    max_size_bytes: int = 4096 * 2**20


def prune(database: sqlite3.Connection, keep: Retention, now_ns: int) -> bool:
    """Drop what `keep` does not keep, and give the space back; the last cycle always stays.

    Called inside no transaction; each step commits by itself, so a crash in between loses nothing else.

    Returns
    -------
    bool
        Whether there may be more to drop; a call drops no more than `PRUNE_LIMIT` for each reason.
    """
    oldest_ns = now_ns - int(keep.days * _NS_PER_DAY)
    oldest_capture_ns = now_ns - int(min(keep.captures_days, keep.days) * _NS_PER_DAY)
    captures = database.execute(
        "DELETE FROM captures WHERE seq IN (SELECT seq FROM cycles WHERE time_ns > 0 AND time_ns < ? "
        "AND EXISTS (SELECT 1 FROM captures WHERE captures.seq = cycles.seq) ORDER BY time_ns LIMIT ?)",
        (oldest_capture_ns, PRUNE_LIMIT),
    )
    cycles = database.execute(
        "DELETE FROM cycles WHERE seq IN (SELECT seq FROM cycles WHERE time_ns > 0 AND time_ns < ? "
        "AND seq < (SELECT max(seq) FROM cycles) ORDER BY time_ns LIMIT ?)",
        (oldest_ns, PRUNE_LIMIT),
    )
    more = PRUNE_LIMIT in (captures.rowcount, cycles.rowcount)
    database.execute("DELETE FROM alarms WHERE time_ns > 0 AND time_ns < ?", (oldest_ns,))
    database.execute("DELETE FROM audit WHERE time_ns < ?", (oldest_ns,))
    for _ in range(PRUNE_LIMIT // _CHUNK):
        if _size(database) <= (1.0 - FREE_SHARE) * keep.max_size_bytes or not _drop_oldest(database):
            break
    else:
        more = True
    # execute() steps this statement once and gives back a single page; executescript() runs it to its end.
    database.executescript("PRAGMA incremental_vacuum")
    database.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchall()
    return more


def _drop_oldest(database: sqlite3.Connection) -> bool:
    """Drop a few of the oldest captures, or cycles where no capture is left; False when nothing is left."""
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
    return cycles.rowcount > 0


def _size(database: sqlite3.Connection) -> int:
    """Bytes in use, free pages not counted."""
    (pages,) = database.execute("PRAGMA page_count").fetchone()
    (free,) = database.execute("PRAGMA freelist_count").fetchone()
    (page_size,) = database.execute("PRAGMA page_size").fetchone()
    return int((pages - free) * page_size)
