"""A friction series from a file as people have it: any separator and decimal mark, every fault at once."""

import csv
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from impactcell.cell.series_replay import whole_number_fault
from impactcell.cli.estimate_columns import COLUMNS as ESTIMATED
from impactcell.errors import MeasurementError, SeriesError
from impactcell.measurements.files.dialect import Dialect, decode, detect, split_cells
from impactcell.measurements.files.lines_left_out import (
    HEADER_AGAIN,
    LONGEST_FOOTER,
    footer_note,
    is_word,
    left_out,
)
from impactcell.measurements.files.text_layout import is_comment
from impactcell.measurements.notation.numbers import is_grouped, is_missing, parse_number
from impactcell.measurements.notation.units import parse_unit
from impactcell.tracking.wear_batch import FrictionObservation

COLUMNS = ("cycle", "mu_s", "mu_s_std", "batch", "mu_s_common_std")
"""What is read; the first two have to be there."""
COMMON_STD = "mu_s_common_std"
"""Column of the part of mu_s_std that all cycles share, as `impactcell estimate` writes it."""
SHOT = "shot"
"""What `impactcell estimate` calls a cycle of a campaign."""
FIRST_LINE = "cycle,mu_s,mu_s_std[,batch]"
"""In words."""
WITHOUT_UNIT = re.compile(r"(.*\S)\s*(?:\[[-1 ]?\]|\([-1]\))")
"""A column's name with what says that it has no unit: `mu_s [-]`."""
DELIMITERS = (",", ";", "\t", "|")
"""What may separate cells; the header tells which."""
SEPARATOR_LINE = "sep="
"""Begin of the line with which Excel says what separates cells."""
MOST_FAULTS = 20
"""Faults told of one file."""
DECIMAL_COMMAS = (
    "rows of more cells: with decimal commas, separate cells by `;`, or put such numbers in quotes"
)
"""Told of a file that has commas between its cells, and may have them within."""
INFINITE = frozenset(("inf", "infinity"))
"""Numbers without sign that are no measurement: the tracker says so."""


@dataclass(frozen=True, slots=True)
class SeriesFile:
    """What a file says.

    Attributes
    ----------
    observations : tuple of FrictionObservation
    has_batch : bool
        There is a column `batch`.
    unread : tuple of str
        Names of columns that are none of `COLUMNS`, nor written by `impactcell estimate`.
    notes : tuple of str
        What was left out, with its line.
    """

    observations: tuple[FrictionObservation, ...]
    has_batch: bool
    unread: tuple[str, ...]
    notes: tuple[str, ...] = ()


def read_series(path: Path) -> SeriesFile:
    """Read a series.

    Raises
    ------
    SeriesError
        No such file, no header, a column missing or twice; every row of another length and every cell that
        is no number, with its line.
    """
    lines = _lines(path)
    head = next(
        (at for at, line in enumerate(lines) if not is_comment(line) and not _is_separator(line)), None
    )
    if head is None:
        raise SeriesError(f"{path}:1: empty; the first line is to be {FIRST_LINE}")
    delimiter, header = _header(f"{path}:{head + 1}", lines[head])
    names = split_cells(lines[head], delimiter)
    _, decimal, _ = detect(lines[head + 1 :], Dialect(delimiter=delimiter))
    readings: list[FrictionObservation] = []
    faults: list[str] = []
    is_longer = False
    rows, notes = list(_rows(path, lines, head + 1, delimiter)), []
    footer = _footer(rows, names, header.index("cycle"), decimal)
    if not footer and len(rows) > 1 and len(rows[-1][1]) < len(header) <= len(rows[-2][1]):
        footer = rows[-1:]
    if footer:
        rows = rows[: -len(footer)]
        notes.append(_left_out(path, footer, delimiter, len(header)))
    for line, row in rows:
        if row == names:
            faults.append(f"{path}:{line}: {HEADER_AGAIN}")
            continue
        if not (readings or faults) and _is_line_of_units(header, row):
            faults.append(f"{path}:{line}: a line of units; leave it out")
            continue
        cells, found = _cells(header, row)
        is_longer |= bool(found) and len(row) > len(header)
        if not found:
            reading, found = _reading(cells, decimal)
            readings.append(reading)
        faults += [f"{path}:{line}: {fault}" for fault in found]
    if faults:
        rest = len(faults) - MOST_FAULTS
        more = [f"{path}: and {rest} more faults"] if rest > 0 else []
        more += [f"{path}: {DECIMAL_COMMAS}"] if is_longer and delimiter == "," else []
        raise SeriesError("\n".join([*faults[:MOST_FAULTS], *more]))
    if not readings:
        raise SeriesError(f"{path}:{head + 2}: no cycles after the header")
    unread = tuple(name for name in header if name and name not in (*COLUMNS, *_of_estimate(header)))
    return SeriesFile(tuple(readings), "batch" in header, unread, tuple(notes))


def _lines(path: Path) -> list[str]:
    try:
        text, _ = decode(path.read_bytes(), str(path), None)
    except OSError as error:
        raise SeriesError(f"{path}: cannot be read: {error.strerror}") from error
    except MeasurementError as error:
        raise SeriesError(
            f"{path}: not a CSV file; save the series as text whose first line is {FIRST_LINE}"
        ) from error
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _is_separator(line: str) -> bool:
    return line.strip().strip('"').lower().startswith(SEPARATOR_LINE)


def _header(place: str, line: str) -> tuple[str, list[str]]:
    """Give the separator and the names of the columns."""
    splits = [(mark, [_column(name) for name in split_cells(line, mark)]) for mark in DELIMITERS]
    delimiter, header = max(splits, key=lambda split: len(set(COLUMNS) & set(split[1])))
    if "cycle" not in header:
        header = ["cycle" if name == SHOT else name for name in header]
    for name in COLUMNS[:2]:
        if name not in header:
            near = _near(name, header)
            raise SeriesError(f"{place}: no column `{name}`{near}; the first line is to be {FIRST_LINE}")
    for name in COLUMNS:
        if header.count(name) > 1:
            raise SeriesError(f"{place}: column `{name}` is there {header.count(name)} times; keep one")
    return delimiter, header


def _of_estimate(header: Sequence[str]) -> Sequence[str]:
    """Give the columns that `impactcell estimate` writes, where all are there: no surprise to anybody."""
    return ESTIMATED if set(ESTIMATED) - {SHOT} <= set(header) else ()


def _column(name: str) -> str:
    """Give the column that a name says in capital letters, or with that it has no unit; else the name."""
    without = WITHOUT_UNIT.fullmatch(name)
    plain = (without[1] if without else name).lower()
    return plain if plain in (*COLUMNS, SHOT) else name


def _near(name: str, header: Sequence[str]) -> str:
    """Name the column that may be meant by one that is not there; empty without such."""
    others = {other.lower(): other for other in header if other not in (*COLUMNS, "mu_k")}
    for near in get_close_matches(name, others, n=1):
        unit = ", and write 0.2 for 20 %" if "%" in near else ""
        return f"; if `{others[near]}` is meant, call it so{unit}"
    return ""


def _is_line_of_units(header: Sequence[str], row: Sequence[str]) -> bool:
    """Whether a row that numbers no cycle has units and nothing else."""
    cycle = row[header.index("cycle")] if len(row) >= len(header) else "1"
    return not cycle.isdigit() and all(parse_unit(cell) or cell.strip("[]") == "#" for cell in row if cell)


def _rows(path: Path, lines: Sequence[str], first: int, delimiter: str) -> Iterator[tuple[int, list[str]]]:
    """Give rows that are not blank, each with the line at which it begins."""
    reader = csv.reader((f"{line}\n" for line in lines[first:]), delimiter=delimiter, strict=True)
    while True:
        line = first + reader.line_num + 1
        try:
            row = next(reader)
        except StopIteration:
            return
        except csv.Error as error:
            raise SeriesError(
                f"{path}:{line}: its quotes do not fit ({error}); correct or remove them"
            ) from error
        cells = [cell.strip() for cell in row]
        if any(cells):
            yield line, cells


def _footer(
    rows: Sequence[tuple[int, list[str]]], names: Sequence[str], numbered: int, decimal: str
) -> Sequence[tuple[int, list[str]]]:
    """Give the rows of words at the end: none has a number where cycles have theirs. As `import` does."""
    count = 0
    for _, row in reversed(rows[1:]):
        if not is_word(row[numbered if numbered < len(row) else 0], decimal):
            break
        count += 1
        if count > LONGEST_FOOTER or row == names:
            return ()
    return rows[len(rows) - count :]


def _left_out(path: Path, footer: Sequence[tuple[int, list[str]]], delimiter: str, width: int) -> str:
    """Say which rows at the end are left out."""
    line, row = footer[0]
    if len(footer) == 1:
        return f"{path}:{line}: left out, {left_out(delimiter.join(row), len(row), width)}"
    return f"{path}: {footer_note([(line, delimiter.join(row)) for line, row in footer])}"


def _cells(header: Sequence[str], row: list[str]) -> tuple[dict[str, str], list[str]]:
    """Give the cells by name, and what is wrong with their number; empty ones beyond the header are none."""
    if len(row) < len(header) or any(row[len(header) :]):
        return {}, [f"{len(row)} cells, but the header has {len(header)}"]
    return dict(zip(header, row, strict=False)), []


def _reading(cells: dict[str, str], decimal: str) -> tuple[FrictionObservation, list[str]]:
    faults = []
    number = parse_number(cells["cycle"], decimal)
    fault = whole_number_fault(math.nan if number is None else number)
    if number is None or fault:
        faults.append(f"cycle `{cells['cycle']}` {fault}; number the rows, leave out what is no cycle")
        number = 0.0
    mu_s, fault_of_mu_s = _number("mu_s", cells["mu_s"], decimal)
    std, fault_of_std = _number("mu_s_std", cells.get("mu_s_std", ""), decimal)
    common, fault_of_common = _number(COMMON_STD, cells.get(COMMON_STD, ""), decimal)
    faults += [fault for fault in (fault_of_mu_s, fault_of_std, fault_of_common) if fault]
    batch = None if is_missing(batch := cells.get("batch", "")) else batch
    return FrictionObservation(int(number), mu_s, std, batch_id=batch, common_std=common), faults


def _number(name: str, cell: str, decimal: str) -> tuple[float, str]:
    """Give a number, and what is wrong with it; nan for a cell that is empty or says that there is none."""
    if not cell:
        return math.nan, ""
    value = math.inf if cell.lower().lstrip("+-") in INFINITE else parse_number(cell, decimal)
    if cell.endswith("%") and (fault := _percent_fault(name, cell)):
        return math.nan, fault
    if value is None or is_grouped(cell, decimal):
        mark = "point" if decimal == "." else "comma"
        return math.nan, f"{name} `{cell}` is not a number with decimal {mark}; leave it empty if missing"
    if name != "mu_s" and (value < 0.0 or math.isinf(value)):
        return value, f"{name} `{cell}` is no standard deviation; leave it empty if it is not known"
    return value, ""


def _percent_fault(name: str, cell: str) -> str:
    """Say what to write for a number in percent; empty where there is none before the sign."""
    percent = parse_number(cell.removesuffix("%").replace(",", "."))
    if percent is None or math.isnan(percent):
        return ""
    share = f"{0.01 * percent:g}".replace(".", "," if "," in cell else ".")
    of_mu_s = f", or {share} times mu_s where it is that of mu_s" if name == "mu_s_std" else ""
    return f"{name} `{cell}` is in percent; write {share}{of_mu_s}"
