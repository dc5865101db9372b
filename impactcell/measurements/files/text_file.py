"""Reads a text file of numbers in any dialect; every cell that is no number is told with its line."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from impactcell.errors import MeasurementError
from impactcell.measurements.files.cells import CHUNK_ROWS, LineFaults, numbers_of
from impactcell.measurements.files.column_groups import by_their_times
from impactcell.measurements.files.dialect import (
    DELIMITERS,
    EIGHT_BIT,
    Dialect,
    decode,
    detect,
    later_lines,
    split_cells,
)
from impactcell.measurements.files.labview import is_labview, read_labview
from impactcell.measurements.files.limits import Limits
from impactcell.measurements.files.lines_left_out import HEADER_AGAIN, footer_begin, footer_note, left_out
from impactcell.measurements.files.names_alone import refuse_names_alone
from impactcell.measurements.files.text_layout import Layout, find_layout, is_comment
from impactcell.measurements.files.thousands import ThousandsWatch
from impactcell.measurements.files.twincat_scope import is_scope_export, read_scope_export
from impactcell.measurements.notation.moments import read_moments
from impactcell.measurements.table import Lines, MeasuredColumn, Table, unique_names
from impactcell.records import Samples


def read_text(path: Path, limits: Limits, given: Dialect) -> tuple[Table, ...]:
    """Read the one table of a text file.

    Raises
    ------
    MeasurementError
        Every cell that is no number and every row of another length, with its line.
    """
    source = str(path)
    text, encoding = decode(path.read_bytes(), source, given.encoding)
    lines = _lines(text, source, limits)
    if is_labview(lines):
        return read_labview(source, lines, limits, given)
    if is_scope_export(lines):
        return read_scope_export(source, lines, limits, given)
    refuse_names_alone(lines, source)
    delimiter, decimal, how = detect([line for line in lines if not is_comment(line)], given)
    layout = find_layout(lines, source, delimiter, decimal, given.lost)
    limits.check_shape(source, len(lines) - layout.first_row, len(layout.names))
    watch, found = ThousandsWatch(decimal), replace(given, delimiter=delimiter, decimal=decimal)
    end = footer_begin(lines, layout, found)
    footer = [(end + at, line) for at, line in enumerate(lines[end:], 1) if not is_comment(line)]
    below = [footer_note(footer)] if footer else []
    lines = lines[:end]
    rows = _Rows(source, lines, layout, found, watch)
    columns, numbers = rows.read()
    if given.decimal is None:
        watch.refuse(source, layout.names)
    notes = [how, f"encoding {encoding.removesuffix('-sig')}", _where(layout)]
    skipped = len(lines) - layout.first_row - len(numbers) - len(rows.left_out)
    if skipped:
        notes.append(f"{skipped} blank or comment lines left out")
    notes += [*rows.left_out, *below]
    table = Table(
        source,
        _kept(layout, columns),
        attributes=layout.attributes,
        notes=tuple(notes),
        lines=numbers,
        decimal=decimal,
        encoding=encoding if given.encoding is None and encoding in EIGHT_BIT else "",
    )
    return by_their_times(table)


def _lines(text: str, source: str, limits: Limits) -> list[str]:
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    nothing = " \t\x1a" + "".join(DELIMITERS)  # a spreadsheet saves rows of no more below a table
    while lines and not lines[-1].strip(nothing):
        lines.pop()
    if not lines:
        raise MeasurementError(f"{source}: is empty; leave the file out, or record it again")
    if '"' in text[:100_000]:
        lines = _joined(lines)
    limits.check_shape(source, len(lines), 1)
    return lines


_OPENS = re.compile(r'(?:^|[,;|\t])\s*"')
"""A cell that begins with a quote; one within a cell, as the inch of `Weg ["]`, is a sign like any other."""


def _joined(lines: list[str]) -> list[str]:
    """Lines with what a quoted cell broke in two put together; the rest of it becomes blank lines.

    A line that has all the separators of a row by itself is a row, and no rest of the one before.
    """
    joined = list(lines)
    separator, count_of_row = _separators_of_row(lines)
    for index in range(len(lines)):
        if '"' not in joined[index] or not _OPENS.search(joined[index]):
            continue
        count = 0
        while joined[index].count('"') % 2 and count < 3 and index + count + 1 < len(lines):
            if count_of_row and lines[index + count + 1].count(separator) == count_of_row:
                break
            count += 1
            joined[index] += " " + joined[index + count]
            joined[index + count] = ""
    return joined


def _separators_of_row(lines: list[str]) -> tuple[str, int]:
    """Give the sign that most lines have equally often, and how often."""
    sample = later_lines(lines)
    commonest = {
        sign: Counter(line.count(sign) for line in sample if sign in line).most_common(1)
        for sign in DELIMITERS
        if sign != " "
    }
    often = {sign: counts[0] for sign, counts in commonest.items() if counts}
    if not often:
        return "", 0
    sign = max(often, key=lambda each: often[each][1])
    return sign, often[sign][0]


def _where(layout: Layout) -> str:
    if layout.header_line is None:
        return f"no header, numbers from line {layout.first_row + 1}"
    units = "" if layout.unit_line is None else f", units in line {layout.unit_line}"
    return f"header in line {layout.header_line}{units}, numbers from line {layout.first_row + 1}"


class _Rows:
    """Rows of a text file, parsed in chunks."""

    def __init__(
        self,
        source: str,
        lines: Sequence[str],
        layout: Layout,
        dialect: Dialect,
        watch: ThousandsWatch,
    ) -> None:
        self._lines = lines
        self._layout = layout
        self._delimiter, self._decimal = dialect.delimiter or ",", dialect.decimal or "."
        self._lost = dialect.lost
        self._watch = watch
        self._width = len(layout.names)
        self._faults = LineFaults(source)
        self._header = None if layout.header_line is None else lines[layout.header_line - 1].strip()
        self.left_out: list[str] = []

    def read(self) -> tuple[list[Samples | list[str]], Lines]:
        """Columns, and the line of each row.

        Raises
        ------
        MeasurementError
            A row has another width or a cell is no finite number; the first faults are told by their lines.
        """
        parts: list[list[Samples | list[str]]] = []
        numbers: list[int] = []
        for chunk in self._chunks():
            rows = self._cells(chunk)
            numbers += [number for number, _ in rows]
            parts.append([self._column(place, rows) for place in range(self._width)])
        self._faults.raise_any()
        columns: list[Samples | list[str]] = []
        for place in range(self._width):
            pieces = [part[place] for part in parts]
            if place in self._layout.numeric:
                columns.append(np.concatenate([np.asarray(piece, dtype=np.float64) for piece in pieces]))
            else:
                columns.append([str(cell) for piece in pieces for cell in piece])
        return columns, np.array(numbers, dtype=np.int64)

    def _chunks(self) -> Iterator[list[tuple[int, str]]]:
        chunk: list[tuple[int, str]] = []
        for index in range(self._layout.first_row, len(self._lines)):
            line = self._lines[index]
            if is_comment(line):
                continue
            chunk.append((index + 1, line))
            if len(chunk) == CHUNK_ROWS:
                yield chunk
                chunk = []
        if chunk:
            yield chunk

    def _cells(self, chunk: list[tuple[int, str]]) -> list[tuple[int, list[str]]]:
        rows = []
        for number, line in chunk:
            if line.strip() == self._header:
                self._faults.add(number, HEADER_AGAIN, HEADER_AGAIN)
                continue
            cells = split_cells(line, self._delimiter)
            if len(cells) != self._width:
                if number == len(self._lines) and len(cells) < self._width:
                    self.left_out.append(f"line {number} left out, {left_out(line, len(cells), self._width)}")
                    continue
                self._faults.add(number, f"{len(cells)} cells where the table has {self._width}")
                continue
            rows.append((number, cells))
        return rows

    def _column(self, place: int, rows: list[tuple[int, list[str]]]) -> Samples | list[str]:
        cells = [row[1][place] for row in rows]
        if place not in self._layout.numeric:
            return cells
        self._watch.look(place, cells)
        name = self._layout.names[place] or f"column {place + 1}"
        return numbers_of(
            cells, [number for number, _ in rows], name, self._decimal, self._faults, self._lost
        )


def _kept(layout: Layout, columns: list[Samples | list[str]]) -> tuple[MeasuredColumn, ...]:
    """Columns of the table; those without name and content, as a delimiter at line ends makes them, go."""
    kept = []
    names = unique_names(list(layout.names))
    for place, content in enumerate(columns):
        unit = layout.units[place]
        if isinstance(content, np.ndarray):
            kept.append(MeasuredColumn(names[place], unit, content))
        elif any(content) or layout.names[place]:
            moments = read_moments(content)
            if moments is None:
                kept.append(MeasuredColumn(names[place], unit, np.full(len(content), np.nan), tuple(content)))
            else:
                kept.append(MeasuredColumn(names[place], "s", moments.seconds, begun=moments.begun))
    return tuple(kept)
