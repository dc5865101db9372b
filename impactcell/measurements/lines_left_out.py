"""Lines of a text file that are no rows of its table, in words."""

from typing import Final

SHOWN: Final = 40
"""Signs of a line that are told."""
HEADER_AGAIN: Final = "the header again; delete the line"


def left_out(line: str, cells: int, width: int) -> str:
    """Say what a last line with fewer cells than the table is: a row that was cut off, or no row.

    >>> left_out("0.02,1", 2, 3), left_out("End of measurement", 1, 3)
    ("cut off after 2 of 3 cells: '0.02,1'", "the last line, and no row of the table: 'End of measurement'")
    """
    text = line.strip()
    shown = repr(text if len(text) <= SHOWN else f"{text[:SHOWN]}...")
    if text.lstrip('+-.,"')[:1].isdigit():
        return f"cut off after {cells} of {width} cells: {shown}"
    return f"the last line, and no row of the table: {shown}"
