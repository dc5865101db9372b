"""Reads `shots.csv`: a row a shot, the columns the format knows and any further covariate."""

import csv
import io
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from impactcell.campaign.contents import COLUMNS, Coordinate, Excitation
from impactcell.campaign.faults import LARGEST, Faults, read_text
from impactcell.records import MM_PER_MIN

LARGEST_SHOT = 2**53
"""Number of a shot beyond which not every whole number has a double."""


@dataclass(frozen=True, slots=True)
class ShotRow:
    """One row of `shots.csv`, in SI units; nan where a cell is empty."""

    number: int
    velocity_m_s: float
    mass_kg: float
    direction: int
    batch_id: str | None
    dwell_s: float
    start_m: float
    covariates: dict[str, float | str]


KNOWN_COLUMNS = ("shot", "velocity_mm_per_min", "direction", "batch", "dwell_s")
"""Columns that the format knows, beside mass and start, whose names go by the coordinate."""


def read_shots(
    file: Path,
    excitation: Excitation | None,
    faults: Faults,
    coordinate: Coordinate = Coordinate.TRANSLATION,
) -> tuple[tuple[str, ...], list[ShotRow]] | None:
    """Columns and rows of `shots.csv`; None after noting every fault of it."""
    text = read_text(file, faults, "write a row for each trace, under a header line with `shot`")
    if text is None:
        return None
    noted = len(faults)
    reader = csv.reader(io.StringIO(text), strict=True)
    try:
        table = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except csv.Error as error:
        faults.add(file, reader.line_num, f"is not CSV: {error}")
        return None
    if not table:
        faults.add(file, None, "is empty; it starts with a header line, of which `shot` is required")
        return None
    (header_line, header), rows = table[0], table[1:]
    names = tuple(name.strip() for name in header)
    _check_names(file, header_line, names, excitation, faults)
    if len(faults) > noted:
        return None
    if not rows:
        faults.add(file, header_line, "has no shots; write a row for each trace")
        return None
    shots = []
    lines: dict[int, int] = {}
    for line, row in rows:
        if len(row) != len(names):
            faults.add(file, line, f"{len(row)} cells where the header has {len(names)}")
            continue
        shot = _Row(file, line, dict(zip(names, (cell.strip() for cell in row), strict=True)), faults).shot(
            excitation, COLUMNS[coordinate]
        )
        if shot is None:
            continue
        if shot.number in lines:
            faults.add(
                file, line, f"shot {shot.number} is in line {lines[shot.number]} already; number it anew"
            )
            continue
        lines[shot.number] = line
        shots.append(shot)
    return None if len(faults) > noted else (names, shots)


def _check_names(
    file: Path, line: int, names: tuple[str, ...], excitation: Excitation | None, faults: Faults
) -> None:
    required = ["shot"] + (["velocity_mm_per_min"] if excitation is Excitation.TAP else [])
    for name in required:
        if name not in names:
            faults.add(file, line, f"no column {name!r} in `{','.join(names)}`")
    for column, name in enumerate(names):
        if not name:
            faults.add(file, line, f"column {column + 1} has no name")
        elif name in names[:column]:
            faults.add(file, line, f"column {name!r} appears twice; keep one")


class _Row:
    def __init__(self, file: Path, line: int, cells: dict[str, str], faults: Faults) -> None:
        self._file = file
        self._line = line
        self._cells = cells
        self._faults = faults

    def shot(self, excitation: Excitation | None, columns: Mapping[str, str]) -> ShotRow | None:
        noted = len(self._faults)
        tap = excitation is Excitation.TAP
        number = self._number("shot", _is_count, "a whole number from 1", required=True)
        velocity = self._number("velocity_mm_per_min", _is_positive, "a positive number", required=tap)
        mass = self._number(columns["mass"], _is_positive, "a positive number or empty")
        direction = self._number("direction", _is_sign, "+1 or -1", default=1.0)
        dwell = self._number("dwell_s", _is_not_negative, "a number from 0 or empty")
        start = self._number(columns["start"], _is_measured, "a finite number or empty", default=0.0)
        covariates = {
            name: self._covariate(name, text)
            for name, text in self._cells.items()
            if name not in (*KNOWN_COLUMNS, columns["mass"], columns["start"])
        }
        if len(self._faults) > noted:
            return None
        batch = self._cells.get("batch") or None
        return ShotRow(
            int(number), velocity * MM_PER_MIN, mass, int(direction), batch, dwell, start, covariates
        )

    def _number(
        self,
        name: str,
        accepts: Callable[[float], bool],
        requirement: str,
        *,
        default: float = math.nan,
        required: bool = False,
    ) -> float:
        text = self._cells.get(name, "")
        if not text and not required:
            return default
        value = _to_float(text)
        if value is None or not accepts(value):
            shown = repr(text) if text else "empty"
            self._faults.add(self._file, self._line, f"{name} is {shown}; it has to be {requirement}")
            return default
        return value

    def _covariate(self, name: str, text: str) -> float | str:
        value = _to_float(text)
        if value is None:
            return text or math.nan
        if abs(value) >= LARGEST:
            self._faults.add(
                self._file, self._line, f"{name} is {text!r}; it has to be a text, a finite number or empty"
            )
        return value


def _to_float(text: str) -> float | None:
    try:
        value = None if "_" in text else float(text)
    except ValueError:
        return None
    return value


def _is_count(value: float) -> bool:
    return 1.0 <= value < LARGEST_SHOT and value == math.floor(value)


def _is_positive(value: float) -> bool:
    return 1.0 / LARGEST < value < LARGEST


def _is_not_negative(value: float) -> bool:
    return 0.0 <= value < LARGEST


def _is_measured(value: float) -> bool:
    return abs(value) < LARGEST


def _is_sign(value: float) -> bool:
    return value in (1.0, -1.0)
