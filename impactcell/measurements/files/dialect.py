"""How a text file separates its cells and writes its numbers, told from the file itself."""

import codecs
import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from impactcell.errors import MeasurementError
from impactcell.measurements.notation.numbers import is_grouped, is_missing, parse_number

DELIMITERS = {";": "semicolon", "\t": "tab", ",": "comma", "|": "bar", " ": "white space"}
"""What separates cells, the likelier first; white space means any run of it."""
DECIMALS = (".", ",")
SAMPLED_LINES = 200
"""Lines in the later part of a file from which its dialect is told: enough for any mixture of cells."""
EIGHT_BIT = ("cp1252", "latin-1")
"""Encodings taken for a file that is no UTF-8: the second has a sign for each byte."""
_ONE_OR_TWO = re.compile(r"\s*[+-]?\d+,\d+\s*")
"""A row that is one number with a decimal comma, or two whole ones."""
_BYTE_ORDER_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


@dataclass(frozen=True, slots=True)
class Dialect:
    """How cells are separated and numbers written; None where the file is to tell.

    Attributes
    ----------
    delimiter : str or None
        One character; a space means any run of white space.
    decimal : str or None
        `.` or `,`.
    encoding : str or None
        As Python calls it.
    lost : frozenset of str
        Words, in lower case, that stand for a value that was lost.
    """

    delimiter: str | None = None
    decimal: str | None = None
    encoding: str | None = None
    lost: frozenset[str] = frozenset()


def decode(content: bytes, source: str, encoding: str | None) -> tuple[str, str]:
    """Text of a file and the encoding it is in.

    Raises
    ------
    MeasurementError
        It is not text, or not in the encoding that was given.
    """
    if encoding is None:
        encoding = _encoding(content, source)
    try:
        text = content.decode(encoding)
    except LookupError as error:
        raise MeasurementError(
            f"{source}: there is no encoding {encoding!r}; utf-8 or cp1252, say"
        ) from error
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise MeasurementError(
            f"{source}:{line}: byte {error.start} is not {encoding}; give the file's encoding, or leave "
            f"it to be told"
        ) from error
    except UnicodeError as error:
        raise MeasurementError(
            f"{source}: is not {encoding}; give the file's encoding, or leave it to be told"
        ) from error
    text = text.removeprefix("\ufeff")
    if "\0" in text:
        raise MeasurementError(f"{source}: is not text (it has zero bytes), and no other kind that is read")
    return text, encoding


def _encoding(content: bytes, source: str) -> str:
    for mark, name in _BYTE_ORDER_MARKS:
        if content.startswith(mark):
            return name
    head = content[:4096]
    if b"\0" in head:
        for name, zeros in (("utf-16-le", head[1::2]), ("utf-16-be", head[::2])):
            if zeros.count(0) > 0.9 * len(zeros):
                return name
        raise MeasurementError(
            f"{source}: is neither text nor Parquet, HDF5, MDF4, TDMS or MATLAB; export it as one of these"
        )
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return EIGHT_BIT[0 if _is_cp1252(content) else 1]
    return "utf-8"


def _is_cp1252(content: bytes) -> bool:
    return not set(content) & {0x81, 0x8D, 0x8F, 0x90, 0x9D}


def split_cells(line: str, delimiter: str) -> list[str]:
    """Cells of a line, without the white space about them; quotes hold a delimiter together."""
    if delimiter == " ":
        return line.split()
    if '"' in line:
        try:
            return [
                cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
            ]
        except (csv.Error, StopIteration):
            return [cell.strip() for cell in line.split(delimiter)]
    return [cell.strip() for cell in line.split(delimiter)]


def later_lines(lines: Sequence[str]) -> Sequence[str]:
    """Up to `SAMPLED_LINES` about three quarters down a file: beyond any preamble, before what may end it."""
    begin = max(0, 3 * len(lines) // 4 - SAMPLED_LINES // 2)
    return lines[begin : begin + SAMPLED_LINES]


def detect(lines: Sequence[str], given: Dialect) -> tuple[str, str, str]:
    """Delimiter, decimal mark, and why, from lines of which most are rows of numbers.

    The pair wins under which most lines have equally many cells and most cells are numbers; then the one with
    more columns, with fewer numbers that need a separator of thousands, and the likelier delimiter. A column
    of its own with decimal commas looks like two of whole numbers, but for its one name.

    Raises
    ------
    MeasurementError
        The given delimiter is the decimal mark, too.
    """
    filled = [line for line in lines if line.strip()]
    sample = later_lines(filled)
    if given.delimiter is None and given.decimal is None and _is_one_column(filled):
        return ";", ",", "one column, decimal comma"
    delimiters = DELIMITERS if given.delimiter is None else {given.delimiter: given.delimiter}
    decimals = DECIMALS if given.decimal is None else (given.decimal,)
    quoted = any('"' in line for line in sample)
    best: tuple[tuple[float, int, int], str, str] | None = None
    for delimiter in delimiters:
        rows = [split_cells(line, delimiter) for line in sample]
        for decimal in decimals:
            if delimiter == decimal and not quoted:
                continue
            score = _score(rows, decimal)
            if best is None or score > best[0]:
                best = (score, delimiter, decimal)
    if best is None:
        raise MeasurementError(f"a delimiter {given.delimiter!r} cannot be the decimal mark too")
    (_, columns, grouped), delimiter, decimal = best
    separator = DELIMITERS.get(delimiter, repr(delimiter))
    note = f"{separator}-separated, decimal {'point' if decimal == '.' else 'comma'}"
    if grouped:
        note += ", thousands separated"
    elif given.decimal is None and columns and (example := _ambiguous_number(sample, delimiter, decimal)):
        note += f" (numbers like {example!r} could be thousands: --decimal says)"
    return delimiter, decimal, note


def _is_one_column(filled: Sequence[str]) -> bool:
    """Whether `12,5` in each row is one number and not two: the line above the first such row is no pair."""
    begin = next((row for row, line in enumerate(filled) if _ONE_OR_TWO.fullmatch(line)), 0)
    if not begin or not all(map(_ONE_OR_TWO.fullmatch, later_lines(filled[begin:]))):
        return False
    above = filled[begin - 1]
    return "," not in above and any(map(str.isalpha, above))


def _score(rows: list[list[str]], decimal: str) -> tuple[float, int, int]:
    """Share of numbers in lines of the commonest length, the number of columns, minus the grouped cells."""
    width, count = Counter(map(len, rows)).most_common(1)[0] if rows else (0, 0)
    cells = [cell for row in rows if len(row) == width for cell in row if not is_missing(cell)]
    if not cells:
        return 0.0, 0, 0
    numbers = [parse_number(cell, decimal) is not None for cell in cells]
    grouped = sum(is_grouped(cell, decimal) for cell in cells)
    return round(count / len(rows) * sum(numbers) / len(cells), 2), width, -grouped


def _ambiguous_number(sample: Sequence[str], delimiter: str, decimal: str) -> str:
    """Give a number that is another one under the other decimal mark where none settles it; else empty."""
    other = "," if decimal == "." else "."
    first = ""
    for line in sample:
        for cell in split_cells(line, delimiter):
            if decimal in cell and is_missing(cell) is False and parse_number(cell, decimal) is not None:
                if not is_grouped(cell, other):
                    return ""
                first = first or cell
    return first
