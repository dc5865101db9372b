"""The past of a cell, read page by page in order of time."""

import math
import sqlite3
import struct
from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar

from impactcell.errors import JournalError
from impactcell.journal.stored_forms import load_alarm
from impactcell.quantities import BY_PATH, HISTORY
from impactcell.records import Alarm, Quality

T = TypeVar("T")

VARIABLES: Final = {path: BY_PATH[path] for path in HISTORY}
"""Quantities with a past, by their OPC UA path."""

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


def stored_values(database: sqlite3.Connection, variable: str, query: HistoryQuery) -> Page[StoredValue]:
    """Read stored values of a variable of `VARIABLES`.

    Raises
    ------
    JournalError
        The variable has no past, or the token is not one of ours.
    """
    if variable not in VARIABLES:
        raise JournalError(f"{variable} has no history; these have: {', '.join(VARIABLES)}")
    quantity = VARIABLES[variable]
    columns = f"seq, time_ns, {quantity.column}, {quantity.quality_column}"
    rows, resume = _page(database, query, columns, "cycles", "seq")
    return Page(
        tuple(
            StoredValue(
                time_ns,
                math.nan if stored is None else stored * quantity.per_si,
                Quality.BAD if level is None else Quality(level),
            )
            for _, time_ns, stored, level in rows
        ),
        resume,
    )


def stored_alarms(database: sqlite3.Connection, query: HistoryQuery) -> Page[Alarm]:
    """Read the states that each transition of an alarm led to; those of conditions not known are left out.

    Raises
    ------
    JournalError
        The token is not one of ours, or a record is of another version.
    """
    rows, resume = _page(database, query, "id, time_ns, record", "alarms", "id")
    try:
        alarms = [load_alarm(record) for _, _, record in rows]
    except ValueError as error:
        raise JournalError(f"the journal's alarms cannot be shown: {error}") from error
    return Page(tuple(alarm for alarm in alarms if alarm is not None), resume)


def _page(
    database: sqlite3.Connection, query: HistoryQuery, columns: str, table: str, key: str
) -> tuple[list[tuple[Any, ...]], bytes | None]:
    direction, beyond = ("DESC", "<") if query.newest_first else ("ASC", ">")
    after = None
    if query.resume is not None:
        try:
            after = _TOKEN.unpack(query.resume)
        except struct.error as error:
            raise JournalError("this token continues no page of a history") from error
    rows = database.execute(
        f"SELECT {columns} FROM {table} "  # noqa: S608 - names from this module only
        "WHERE (?1 IS NULL OR time_ns >= ?1) AND (?2 IS NULL OR time_ns <= ?2) "
        f"AND (?3 IS NULL OR (time_ns, {key}) {beyond} (?3, ?4)) "
        f"ORDER BY time_ns {direction}, {key} {direction} LIMIT ?5",
        (query.start_ns, query.end_ns, *(after or (None, None)), query.limit + 1),
    ).fetchall()
    more = len(rows) > query.limit
    rows = rows[: query.limit]
    return rows, _TOKEN.pack(rows[-1][1], rows[-1][0]) if more and rows else None
