"""Columns that are called as a time or a channel and hold text, which would be left out silently."""

import re
from collections.abc import Mapping, Sequence

from impactcell.measurements.columns.assignment import Assignment
from impactcell.measurements.columns.recognition import (
    CHANNELS,
    UNIT_MATCH,
    VOCABULARY,
    WORD_MATCH,
    ColumnMeaning,
    name_score,
)
from impactcell.measurements.notation.moments import unread_moments
from impactcell.measurements.notation.numbers import is_missing, parse_number
from impactcell.measurements.notation.units import Dimension, parse_unit
from impactcell.measurements.table import MeasuredColumn, Table

ROW_QUANTITIES = (ColumnMeaning.TIME, *CHANNELS)
"""Quantities of which each row has a number."""
THINGS = frozenset((
    "part", "teil", "bauteil", "werkstueck", "slider", "load_cell", "loadcell", "kraftsensor",
    "kraftaufnehmer", "dms", "laser", "wegsensor", "encoder", "actuator", "aktor", "aktuator", "ram",
    "stoessel", "pusher", "plunger", "tool", "schieber", "stempel", "axis", "achse", "datum",
))  # fmt: skip
"""Words of a channel under which a text may also say which part, sensor, tool or day it was."""
SHOWN = 40
"""Signs of a cell that are told."""
_NUMBER_AND_UNIT = re.compile(r"([+\-−]?[.,]?\d[\d.,]*(?:[eE][+-]?\d+)?)\s*(\S*)")


def text_channels(
    assignments: Sequence[Assignment], tables: Sequence[Table]
) -> dict[str, tuple[ColumnMeaning, str]]:
    """Tell the columns of text that are called as a time or a channel: what each is, and its fault.

    A text under a name that says nothing, and one that stands beside a surer column, may be there.
    """
    items = {item.column: item for item in assignments}
    taken = {item.meaning: item.confidence for item in assignments}
    told: dict[str, tuple[ColumnMeaning, str]] = {}
    for table in tables:
        for column in table.columns:
            if column.text is None or column.name in told or all(map(is_missing, column.text)):
                continue
            meaning = _meaning(column.text, items[column.name], taken)
            if meaning is not None:
                told[column.name] = meaning, _fault(table, column, column.text, meaning)
    return told


def _meaning(
    cells: Sequence[str], item: Assignment, taken: Mapping[ColumnMeaning, float]
) -> ColumnMeaning | None:
    """Give what a column of text should have been a channel of, None where it may be text."""
    if item.meaning in ROW_QUANTITIES:
        return item.meaning
    if item.meaning is not ColumnMeaning.COVARIATE or item.confidence == 1.0:
        return None
    found = []
    for meaning in ROW_QUANTITIES:
        score, word = name_score(item.column, meaning)
        fits = item.unit is not None and item.unit.dimension in VOCABULARY[meaning].dimensions
        contrary = item.unit is not None and not fits and item.unit.dimension is not Dimension.NONE
        surest = score + (UNIT_MATCH if fits else 0.0)
        if not score or contrary or surest < taken.get(meaning, 0.0):
            continue
        is_named = score >= WORD_MATCH and word not in THINGS
        if fits or is_named or len({cell for cell in cells if _measures(cell, meaning)}) > 1:
            found.append((surest, meaning))
    return max(found, key=lambda one: one[0])[1] if found else None


def _measures(cell: str, meaning: ColumnMeaning) -> bool:
    """Whether a cell is a number under either decimal mark, alone or with a unit of the quantity."""
    match = _NUMBER_AND_UNIT.fullmatch(cell.strip())
    if match is None:
        return False
    unit = parse_unit(match[2])
    return not match[2] or (unit is not None and unit.dimension in VOCABULARY[meaning].dimensions)


def _fault(table: Table, column: MeasuredColumn, cells: Sequence[str], meaning: ColumnMeaning) -> str:
    row = _first_text(cells)
    match = _NUMBER_AND_UNIT.fullmatch(cells[row].strip())
    holds, way = "text", "correct the cell, or leave it empty"
    if match is not None and parse_unit(match[2]) is not None:
        holds, way = "units in its cells", "put the unit behind the name of the column"
    without = f"leave the column out with --column 'ignored={column.name}'"
    if meaning is ColumnMeaning.TIME:
        way = way.removesuffix(", or leave it empty")
        without += " and give the rate with --set rate=10kHz"
        dates, way_of_dates = unread_moments(cells)
        holds, way = dates or holds, way_of_dates or way
    return (
        f"{table.place(row)}: column {column.name!r} holds {holds}, as {cells[row][:SHOWN]!r}, where the "
        f"{meaning} is needed; {way}, or {without}"
    )


def _first_text(cells: Sequence[str]) -> int:
    """Row of the first cell that is a number under neither decimal mark; else under one of them."""
    for marks in (".,", ".", ","):
        for row, cell in enumerate(cells):
            if all(parse_number(cell, mark) is None for mark in marks):
                return row
    return 0
