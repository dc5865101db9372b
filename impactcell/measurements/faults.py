"""Faults of files that are imported, told together."""

import re
from collections.abc import Sequence
from typing import Final

from impactcell.errors import MeasurementError

MAX_FAULTS_TOLD = 10
"""Faults told of one import."""
_QUOTED_OR_NUMBER: Final = re.compile(r"('[^']*')|\d+(?:\.\d+)?")


def raise_faults(faults: Sequence[str]) -> None:
    """Raise `MeasurementError` with the first faults, a line each, and how many more there are; if any.

    Faults that differ in file, row, shot and figures only are told once, with their number.
    """
    if not faults:
        return
    alike: dict[str, list[str]] = {}
    for fault in faults:
        alike.setdefault(_without_place(fault), []).append(fault)
    told = [
        first if not others else f"{first} (and {len(others)} more like this)"
        for first, *others in alike.values()
    ]
    rest = sum(map(len, [*alike.values()][MAX_FAULTS_TOLD:]))
    more = [f"and {rest} more faults"] if rest else []
    raise MeasurementError("\n".join([*told[:MAX_FAULTS_TOLD], *more]))


def _without_place(fault: str) -> str:
    """Leave out the file and row that a fault begins with, and its figures; quoted names stay.

    >>> _without_place("b.csv:12: column 'c7' has 3 values")
    "column 'c7' has # values"
    """
    _, _, what = fault.partition(": ")
    return _QUOTED_OR_NUMBER.sub(lambda found: found[1] or "#", what or fault)
