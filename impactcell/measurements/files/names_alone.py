"""Text files that end with the names of their columns: a recorder was started, and recorded nothing."""

import re
from collections.abc import Sequence

from impactcell.errors import MeasurementError
from impactcell.measurements.files.dialect import DELIMITERS, split_cells
from impactcell.measurements.files.text_layout import is_comment

_LIKE_NUMBER = re.compile(r"\s*[-+]?[.,]?\d")
"""How a number, a date and a time of day begin."""


def refuse_names_alone(lines: Sequence[str], source: str) -> None:
    """Refuse a file that ends with names of columns and has no row of numbers at all.

    Raises
    ------
    MeasurementError
        With the line of the names, or that its lines are those of JSON.
    """
    if lines and re.fullmatch(r"\s*\{.*\}\s*", lines[0]):
        raise MeasurementError(
            f"{source}: has a JSON object in each line, which is not read; write them as one list, "
            "[{...}, {...}], in a file that ends in .json"
        )
    last = -1
    for index, line in enumerate(lines):
        if is_comment(line):
            continue
        if any(_is_of_numbers(split_cells(line, delimiter)) for delimiter in DELIMITERS):
            return
        last = index
    if last >= 0 and any(_are_names(split_cells(lines[last], sign)) for sign in DELIMITERS if sign != " "):
        raise MeasurementError(
            f"{source}:{last + 1}: has no samples below its names; leave the file out, or record it again"
        )


def _is_of_numbers(cells: Sequence[str]) -> bool:
    """Whether most cells, or the first and half of them, begin as a number or a time of day does."""
    like = [bool(_LIKE_NUMBER.match(cell)) for cell in cells]
    return 2 * sum(like) > len(cells) or (any(like[:1]) and 2 * sum(like) == len(cells))


def _are_names(cells: Sequence[str]) -> bool:
    return len(cells) > 1 and all(cell.strip() and not _LIKE_NUMBER.match(cell) for cell in cells)
