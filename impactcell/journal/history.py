"""The past of a cell, read page by page in order of time."""

import math
import sqlite3
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar

from impactcell.errors import JournalError
from impactcell.journal.checksums import SqlValue
from impactcell.quantities import BY_PATH, HISTORY
from impactcell.records import Quality

T = TypeVar("T")

VARIABLES: Final = {path: BY_PATH[path] for path in HISTORY}
"""Quantities with a past, by their OPC UA path."""

IsWhole = Callable[[str, Sequence[SqlValue]], bool]
"""Whether a row of a table is as it was written."""

_TOKEN = struct.Struct(">qq")


@dataclass(frozen=True, slots=True)
class HistoryQuery:
    """Which part of the past is wanted.

    Attributes
    ----------
    start_ns, end_ns : int or None
        Both ends inclusive, nanoseconds since 1970; None is open.
    limit : int
        Entries in a page, at most.
    newest_first : bool
        Reverses the order.
    resume : bytes or None
        Continues an earlier page of the same question.
    """

    start_ns: int | None = None
    end_ns: int | None = None
    limit: int = 1000
    newest_first: bool = False
    resume: bytes | None = None


@dataclass(frozen=True, slots=True)
class StoredValue:
    """One stored value; nan where the cycle had none."""

    time_ns: int
    value: float
    quality: Quality


@dataclass(frozen=True, slots=True)
class Page(Generic[T]):
    """Entries in order, and the token that continues them; None where nothing is left."""

    entries: tuple[T, ...]
    resume: bytes | None


def stored_values(
    database: sqlite3.Connection, variable: str, query: HistoryQuery, is_whole: IsWhole
) -> Page[StoredValue]:
    """Read stored values of a variable of `VARIABLES`; damaged rows are left out.

    Raises
    ------
    JournalError
        The variable has no past, or the token is not one of ours.
    """
    if variable not in VARIABLES:
        raise JournalError(f"{variable} has no history; these have: {', '.join(VARIABLES)}")
    quantity = VARIABLES[variable]
    columns, rows, resume = _page(database, query, "cycles", "seq")
    wanted = (columns.index(str(n)) for n in ("time_ns", quantity.column, quantity.quality_column))
    at_time, at_value, at_quality = wanted
    return Page(
        tuple(
            StoredValue(
                row[at_time],
                math.nan if row[at_value] is None else row[at_value] * quantity.per_si,
                Quality.BAD if row[at_quality] is None else Quality(row[at_quality]),
            )
            for row in rows
            if is_whole("cycles", row)
        ),
        resume,
    )


def stored_alarms(database: sqlite3.Connection, query: HistoryQuery, is_whole: IsWhole) -> Page[str]:
    """Read the states that each transition of an alarm led to, as stored; damaged rows are left out.

    Raises
    ------
    JournalError
        The token is not one of ours.
    """
    columns, rows, resume = _page(database, query, "alarms", "id")
    at_record = columns.index("record")
    return Page(tuple(str(row[at_record]) for row in rows if is_whole("alarms", row)), resume)


def _page(
    database: sqlite3.Connection, query: HistoryQuery, table: str, key: str
) -> tuple[list[str], list[tuple[Any, ...]], bytes | None]:
    direction, beyond = ("DESC", "<") if query.newest_first else ("ASC", ">")
    # Only what is asked stands in the statement, so that SQLite goes to the first row by its index: a page
    # deep in the past costs what the first one does.
    start_ns, end_ns = query.start_ns, query.end_ns
    conditions, bounds = ["TRUE"], list[int]()
    if query.resume is not None:
        conditions.append(f"(time_ns, {key}) {beyond} (?, ?)")
        try:
            bounds += _TOKEN.unpack(query.resume)
        except struct.error as error:
            raise JournalError("this token continues no page of a history") from error
        start_ns, end_ns = (start_ns, bounds[0]) if query.newest_first else (bounds[0], end_ns)
    if start_ns is not None:
        conditions.append("time_ns >= ?")
        bounds.append(start_ns)
    if end_ns is not None:
        conditions.append("time_ns <= ?")
        bounds.append(end_ns)
    cursor = database.execute(
        f"SELECT * FROM {table} WHERE {' AND '.join(conditions)} "  # noqa: S608 - names from this module only
        f"ORDER BY time_ns {direction}, {key} {direction} LIMIT ?",
        (*bounds, query.limit + 1),
    )
    columns, rows = [str(name) for name, *_ in cursor.description], cursor.fetchall()
    more, rows = len(rows) > query.limit, rows[: query.limit]
    if not (more and rows):
        return columns, rows, None
    last = rows[-1]
    return columns, rows, _TOKEN.pack(last[columns.index("time_ns")], last[columns.index(key)])
