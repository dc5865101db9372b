"""Lines of a text file that are no rows of its table, in words."""

from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from typing import Final

from impactcell.measurements.files.dialect import Dialect, split_cells
from impactcell.measurements.files.text_layout import Layout, is_comment
from impactcell.measurements.notation.numbers import is_missing, parse_number

SHOWN: Final = 40
"""Signs of a line that are told."""
LONGEST_FOOTER: Final = 30
"""Lines below a table that are taken for a footer, at most: of more, something became of the first column."""
LINES_SHOWN: Final = 3
"""Lines of a footer that are told."""
HEADER_AGAIN: Final = "the header again; delete the line"


def left_out(line: str, cells: int, width: int) -> str:
    """Say what a last line with fewer cells than the table is: a row that was cut off, or no row.

    >>> left_out("0.02,1", 2, 3), left_out("End of measurement", 1, 3)
    ("cut off after 2 of 3 cells: '0.02,1'", "the last line, and no row of the table: 'End of measurement'")
    """
    shown, text = _shown(line), line.strip()
    if _begins_as_number(text):
        return f"cut off after {cells} of {width} cells: {shown}"
    return f"the last line, and no row of the table: {shown}"


def footer_begin(lines: Sequence[str], layout: Layout, dialect: Dialect) -> int:
    """Index from which on lines are words below a table: none has a number in its first column.

    A word that stands for a lost value is no such, nor is the header that comes again, nor what begins as a
    number does. The number of lines where there is no footer.
    """
    header = None if layout.header_line is None else lines[layout.header_line - 1].strip()
    begin, count = len(lines), 0
    for index in range(len(lines) - 1 if 0 in layout.numeric else -1, layout.first_row, -1):
        if is_comment(lines[index]):
            continue
        cell = split_cells(lines[index], dialect.delimiter or ",")[0].strip()
        if not is_word(cell, dialect.decimal or ".", dialect.lost):
            break
        begin, count = index, count + 1
        if count > LONGEST_FOOTER or lines[index].strip() == header:
            return len(lines)
    return begin


def is_word(cell: str, decimal: str, lost: AbstractSet[str] = frozenset()) -> bool:
    """Whether a cell where a table has numbers has a word: none for a lost value, no begin of a number.

    >>> [is_word(cell, ".") for cell in ("Mean: 0.2", "1.5.2026", "n/a", "")]
    [True, False, False, False]
    """
    is_number = parse_number(cell, decimal) is not None or _begins_as_number(cell)
    return not (is_number or is_missing(cell) or cell.lower() in lost)


def footer_note(footer: Sequence[tuple[int, str]]) -> str:
    """Say which lines are a footer, given each with its number, and how they begin."""
    told = ", ".join(_shown(line) for _, line in footer[:LINES_SHOWN])
    more = ", ..." if len(footer) > LINES_SHOWN else ""
    first, last = footer[0][0], footer[-1][0]
    if len(footer) == 1:
        return f"line {first} left out, the last line, and no row of the table: {told}"
    return f"lines {first} to {last} left out, below the table and no rows of it: {told}{more}"


def _shown(line: str) -> str:
    text = line.strip()
    return repr(text if len(text) <= SHOWN else f"{text[:SHOWN]}...")


def _begins_as_number(text: str) -> bool:
    return text.lstrip('+-.,"')[:1].isdigit()
