"""Which records of a file a table without a channel tells of, by the groups in which they stand."""

import re
from collections.abc import Mapping as AbstractMapping
from collections.abc import Sequence

from impactcell.measurements.columns.mapping import Mapping
from impactcell.measurements.columns.recognition import ColumnMeaning
from impactcell.measurements.columns.scalars import SCALARS
from impactcell.measurements.table import Table

_BETWEEN = re.compile("[/.]")
"""What stands between the names of groups within groups."""


def places_beside(
    before: AbstractMapping[Table, int], groups: AbstractMapping[str, Sequence[str]], mapping: Mapping
) -> dict[Table, set[int]]:
    """Give the places of the records that each table without a channel tells of.

    They are those of its group, or of the next around it that has any. Where several tables tell the same of
    the same records, as one after each, it is the one before.

    Parameters
    ----------
    before : mapping
        Place of the record before each table.
    groups : mapping
        Groups of the records of each file, in their order.
    mapping : Mapping
    """
    shot = mapping.of(ColumnMeaning.SHOT)
    told = {
        item.column for item in mapping.assignments if item.meaning in (*SCALARS, ColumnMeaning.COVARIATE)
    }
    said = {table: told & {column.name for column in table.columns} for table in before}
    places = {table: _around(table, groups[table.source]) for table in before}

    def is_one_of_several(table: Table) -> bool:
        if shot is not None and table.column(shot.column) is not None:
            return False
        return any(
            other is not table
            and other.source == table.source
            and said[other] & said[table]
            and places[other] == places[table]
            for other in before
        )

    return {table: {of} if is_one_of_several(table) else places[table] for table, of in before.items()}


def _around(table: Table, groups: Sequence[str]) -> set[int]:
    around = _BETWEEN.split(table.name)
    of = [_BETWEEN.split(group)[: len(around)] for group in groups]
    deepest = next((n for n in range(len(around), 0, -1) if any(one[:n] == around[:n] for one in of)), 0)
    return {place for place, one in enumerate(of) if one[:deepest] == around[:deepest]}
