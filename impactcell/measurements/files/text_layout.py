"""Where in a text file the table begins: the lines before it, its names, its units, its first row."""

import re
from collections import Counter
from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass

from impactcell.errors import MeasurementError
from impactcell.measurements.files.dialect import SAMPLED_LINES, later_lines, split_cells
from impactcell.measurements.notation.numbers import is_missing, parse_number
from impactcell.measurements.notation.units import parse_unit, split_units

HEAD_LINES = 2000
"""Lines among which the first row of numbers is looked for; no preamble that we met has more than some
100."""
NUMERIC_SHARE = 0.9
"""Share of numbers from which on a column of the sampled rows is one of numbers."""
CONFIRMING_ROWS = 3
"""Rows after the first that have to be rows of numbers too, lest a preamble's figures are taken for it."""
HEADER_ROWS = 4
"""Rows above the numbers that may be names, units and descriptions."""
COMMENT_SIGNS = ("#", "%", "//")
"""Begin of a line that is no row."""
NO_VALUE = re.compile(r"#(?:nv|n/a)(?=[;,|\s]|$)", re.IGNORECASE)
"""Begin of a row whose first cell has no value, as spreadsheets write it."""

UNIT_LABELS = frozenset(("unit", "units", "einheit", "einheiten"))
"""What stands before the units of a row, and is none of them."""

_STATED = re.compile(r"\s*[A-Za-z][A-Za-z0-9_ ]*=.*")
"""A cell that says something of its column."""
Row = tuple[int, list[str]]
"""Index of a line, and its cells."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Where the table is.

    Attributes
    ----------
    names : tuple of str
        Of the columns; empty where the file gives none.
    units : tuple of str or None
    numeric : frozenset of int
        Columns of numbers; the others hold text.
    first_row : int
        Index of the first line of numbers.
    header_line, unit_line : int or None
        Counted from 1.
    attributes : dict
        `key: value` of the lines before the table.
    """

    names: tuple[str, ...]
    units: tuple[str | None, ...]
    numeric: frozenset[int]
    first_row: int
    header_line: int | None
    unit_line: int | None
    attributes: dict[str, str]


def find_layout(
    lines: Sequence[str], source: str, delimiter: str, decimal: str, lost: AbstractSet[str] = frozenset()
) -> Layout:
    """Find the table in the lines of a file, whose cells may hold words for lost values, in lower case.

    Raises
    ------
    MeasurementError
        There is no table of numbers, or its header does not fit its rows.
    """
    width, numeric = _body(lines, delimiter, decimal, lost)
    if not numeric:
        raise MeasurementError(
            f"{source}: no table of numbers was found; say --delimiter and --decimal if there is one"
        )
    first = _first_row(lines, delimiter, decimal, width, numeric)
    if first is None:
        raise MeasurementError(
            f"{source}: no row of {width} cells with numbers was found in the first {HEAD_LINES} lines; "
            f"cut off "
            f"what is before the table"
        )
    above: list[Row] = []
    for index, cells in _rows_above(lines, first, delimiter, width, source):
        if not _has_number(cells, numeric, decimal):
            above.append((index, cells))
        elif above and _has_word(cells, numeric, decimal):
            break  # a figure of the preamble, as `Interval,0.0005,Interval,0.0005` above names and units
        elif not is_comment(lines[index]):
            raise MeasurementError(
                f"{source}:{index + 1}: {delimiter.join(cells)[:60]!r} is neither a header nor a row of "
                f"numbers; correct or remove the line"
            )
    stated = [row for row in above if _is_stated(row[1])]
    above = [row for row in above if row not in stated]
    unit_row = next((row for row in above if _is_unit_row(row[1])), None)
    header = _header(above, unit_row)
    names, units = _named(header, unit_row, above, width)
    table_rows = [row[0] for row in (header, unit_row) if row is not None]
    return Layout(
        tuple(names), tuple(unit or None for unit in units), numeric, first,
        None if header is None else header[0] + 1, None if unit_row is None else unit_row[0] + 1,
        {**_attributes(lines[: min(table_rows, default=first)], delimiter), **_said_of_all(stated)},
    )  # fmt: skip


def _is_stated(cells: Sequence[str]) -> bool:
    """Whether a row says something of each column and names none, as `SampleRate=1000 Hz` or `dx=0,001 s`."""
    filled = [cell for cell in cells if cell.strip()]
    return bool(filled) and all(_STATED.fullmatch(cell) for cell in filled)


def _said_of_all(rows: Sequence[Row]) -> dict[str, str]:
    """Give what such rows say alike of all columns."""
    said = {}
    for _, cells in rows:
        filled = {cell.strip() for cell in cells if cell.strip()}
        if len(filled) == 1:
            key, _, value = filled.pop().partition("=")
            said[key.strip()] = value.strip()
    return said


def _has_number(cells: Sequence[str], numeric: frozenset[int], decimal: str) -> bool:
    """Whether a row has a number where the table has numbers; a header has none there."""
    return any(
        parse_number(cells[column], decimal) is not None and not is_missing(cells[column])
        for column in numeric
    )


def _has_word(cells: Sequence[str], numeric: frozenset[int], decimal: str) -> bool:
    """Whether a row has a text where the table has numbers."""
    return any(
        parse_number(cells[column], decimal) is None and not is_missing(cells[column]) for column in numeric
    )


def _named(
    header: Row | None, unit_row: Row | None, above: Sequence[Row], width: int
) -> tuple[list[str], list[str]]:
    """Names and units of the columns, from a row each or from one row of both."""
    names, units = [""] * width, [""] * width
    if header is None:
        if unit_row is not None:
            units = [cell.strip("[]() ") if parse_unit(cell) else "" for cell in unit_row[1]]
        return names, units
    for place, (name, unit) in enumerate(split_units(header[1])):
        names[place] = name
        units[place] = unit or ""
    if unit_row is not None:
        for place, cell in enumerate(unit_row[1]):
            if cell.strip().lower() in UNIT_LABELS:
                names[place] = ""  # what stands here says of its row what it is, not of its column
            else:
                units[place] = cell.strip("[]() ") or units[place]
        return names, units
    over = next((row[1] for row in above if row[0] < header[0]), None)
    for place, cell in enumerate(header[1]):
        # A row may hold units of some columns and better names of others: `Time, Channel 1` over `ms, Speed`.
        if over is not None and over[place] and parse_unit(cell) and not parse_unit(over[place]):
            names[place], units[place] = over[place], cell
    return names, units


def is_comment(line: str) -> bool:
    """Whether a line is blank or begins as a comment does."""
    text = line.strip()
    return not text or (text.startswith(COMMENT_SIGNS) and not NO_VALUE.match(text))


def _body(
    lines: Sequence[str], delimiter: str, decimal: str, lost: AbstractSet[str]
) -> tuple[int, frozenset[int]]:
    """Cells of a row, and the columns that are numbers, from lines in the later part of the file."""
    filled = [line for line in lines if not is_comment(line)]
    rows = [split_cells(line, delimiter) for line in later_lines(filled)]
    if not rows:
        return 0, frozenset()
    width = Counter(map(len, rows)).most_common(1)[0][0]
    rows = [row for row in rows if len(row) == width]
    rows = rows[len(rows) // 2 :] if len(filled) < SAMPLED_LINES else rows
    spread = [split_cells(line, delimiter) for line in filled[:: len(filled) // HEAD_LINES + 1]]
    numeric = set()
    for column in range(width):
        cells = [row[column] for row in rows if _is_there(row[column], lost)]
        if not cells:  # a channel that ended before the others
            cells = [row[column] for row in spread if len(row) == width and _is_there(row[column], lost)]
        numbers = sum(parse_number(cell, decimal) is not None for cell in cells)
        if cells and numbers >= NUMERIC_SHARE * len(cells):
            numeric.add(column)
    return width, frozenset(numeric)


def _is_there(cell: str, lost: AbstractSet[str]) -> bool:
    """Whether a cell stands for a value, be it a number or not."""
    return not is_missing(cell) and cell.lower() not in lost


def _first_row(
    lines: Sequence[str], delimiter: str, decimal: str, width: int, numeric: frozenset[int]
) -> int | None:
    def is_row(line: str) -> bool:
        cells = split_cells(line, delimiter)
        if len(cells) != width:
            return False
        values = [parse_number(cells[column], decimal) for column in numeric]
        present = [not is_missing(cells[column]) for column in numeric]
        return any(present) and all(value is not None for value in values)

    for index in range(min(len(lines), HEAD_LINES)):
        if is_comment(lines[index]) or not is_row(lines[index]):
            continue
        after = [line for line in lines[index + 1 : index + 20] if not is_comment(line)][:CONFIRMING_ROWS]
        if all(map(is_row, after[:-1])):
            return index
    return None


def _rows_above(lines: Sequence[str], first: int, delimiter: str, width: int, source: str) -> list[Row]:
    """Rows directly above the numbers that have a cell for each column, the nearest first."""
    rows: list[Row] = []
    for index in range(first - 1, -1, -1):
        line = re.sub(r"^\s*(#|%|//)+\s*", "", lines[index])
        if not line.strip():
            if rows:
                break
            continue
        cells = _header_cells(line, delimiter, width)
        if len(cells) == width + 1 and not cells[-1]:
            cells.pop()  # a delimiter at its end that the rows lack
        if len(cells) != width or len(rows) == HEADER_ROWS:
            near = not rows and width > 2 and abs(len(cells) - width) == 1 and not is_comment(lines[index])
            if near or (not rows and len(cells) > width > 1):
                raise MeasurementError(
                    f"{source}:{index + 1}: {len(cells)} cells where the rows below have {width}; correct "
                    f"the line"
                )
            break
        rows.append((index, cells))
    return rows


def _header_cells(line: str, delimiter: str, width: int) -> list[str]:
    """Cells of a header; where white space separates, units in brackets belong to the name before."""
    cells = split_cells(line, delimiter)
    if delimiter != " " or len(cells) == width:
        return cells
    wide = [cell for cell in re.split(r"\t|\s{2,}", line.strip()) if cell]
    if len(wide) == width:
        return wide
    return [cell.replace("\0", " ") for cell in re.sub(r"\s+(?=[\[(/])", "\0", line.strip()).split()]


def _is_unit_row(cells: list[str]) -> bool:
    filled = [cell for cell in cells if cell.strip("[]() ") and cell.strip().lower() not in UNIT_LABELS]
    known = sum(parse_unit(cell) is not None and cell != "d" for cell in filled)  # d is rather a name
    return bool(filled) and known > 0.6 * len(filled)


def _header(above: list[Row], unit_row: Row | None) -> Row | None:
    """Row of the names: the nearest above the units, or above the numbers."""
    if unit_row is None:
        return above[0] if above else None
    before = [row for row in above if row[0] < unit_row[0]]
    rows = before or [row for row in above if row is not unit_row]
    return rows[0] if rows else None


def _attributes(lines: Sequence[str], delimiter: str) -> dict[str, str]:
    """Collect what the lines before the table say as `key: value`, `key = value` or in two cells."""
    said: dict[str, str] = {}
    for line in lines[:HEAD_LINES]:
        text = re.sub(r"^\s*(#|%|//)+\s*", "", line).strip().strip('"')
        match = re.fullmatch(r"([^:=]{1,60}?)\s*[:=]\s*(.+)", text)
        if match:
            said[match.group(1)] = match.group(2).strip(f' "{delimiter}')
            continue
        cells = [cell for cell in split_cells(text, delimiter) if cell] if delimiter != " " else []
        if len(cells) in (2, 3):
            said[cells[0]] = " ".join(cells[1:])
        elif len(cells) % 2 == 0 and len({*cells[::2]}) == 1 == len({*cells[1::2]}):
            said[cells[0]] = cells[1]  # once for each channel
    return said
