"""Rows that stand twice in a file, as where a recorder wrote its buffer again."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from impactcell.measurements.columns.given_values import Given
from impactcell.measurements.columns.recognition import SYMBOL_MATCH, ColumnMeaning, name_score
from impactcell.measurements.table import MeasuredColumn, Table


def without_repeats(tables: Sequence[Table], given: Given) -> tuple[list[Table], list[str]]:
    """Give the tables without rows that repeat the one before, its time and all, and tell of them.

    Rows of which only the time is that of the row before are no repeats: rounding makes such times, and
    where a table has some of them, rows that are alike are samples of a part at rest.
    """
    kept: list[Table] = []
    left_out: list[str] = []
    for table in tables:
        repeats = _repeats(table, given)
        kept.append(table.rows(np.flatnonzero(~repeats)) if repeats.any() else table)
        left_out += [Path(table.source).name] * int(repeats.sum())
    if not left_out:
        return kept, []
    where = "in" if len(set(left_out)) == 1 else "the first in"
    return kept, [f"rows left out that stand twice: {len(left_out)}, {where} {left_out[0]}"]


def _repeats(table: Table, given: Given) -> NDArray[np.bool_]:
    """Whether each row repeats the one before; of none where a time comes again with other values."""
    none = np.zeros(len(table), dtype=np.bool_)
    time = next((column for column in table.columns if _is_time(column, given)), None)
    if time is None:
        return none
    stays = np.concatenate([[False], time.values[1:] == time.values[:-1]])
    if not stays.any() or stays[1:].all():
        return none
    alike = np.all([stays, *map(_is_as_before, table.columns)], axis=0)
    return alike if (alike == stays).all() else none


def _is_time(column: MeasuredColumn, given: Given) -> bool:
    if ColumnMeaning.TIME in given.columns:
        return column.name == given.columns[ColumnMeaning.TIME]
    return column.text is None and name_score(column.name, ColumnMeaning.TIME)[0] >= SYMBOL_MATCH


def _is_as_before(column: MeasuredColumn) -> NDArray[np.bool_]:
    """Whether a column has in each row what it has in the one before, be it nothing."""
    if column.text is not None:
        cells = np.array(column.text)
        return np.concatenate([[False], cells[1:] == cells[:-1]])
    empty = np.isnan(column.values)
    same = (column.values[1:] == column.values[:-1]) | (empty[1:] & empty[:-1])
    return np.concatenate([[False], same])
