"""Reads one trace: a column of time, a column a channel, an empty cell where a channel was not sampled."""

from pathlib import Path

import numpy as np

from impactcell.campaign.contents import CHANNELS, COLUMNS, Coordinate
from impactcell.campaign.faults import LARGEST, Faults, read_text
from impactcell.records import Samples

MAX_FAULTS_PER_TRACE = 3
"""Faults of one kind told of one trace."""


def read_trace(
    file: Path, faults: Faults, coordinate: Coordinate = Coordinate.TRANSLATION
) -> dict[str, tuple[Samples, Samples]] | None:
    """Channels of a trace by sensor name.

    Returns
    -------
    dict or None
        For each sensor its times and values, shape (n,) each, at the times at which it was sampled;
        None after noting every fault of the file.
    """
    columns = {sensor: COLUMNS[coordinate][sensor] for sensor in CHANNELS}
    text = read_text(file, faults, "take the shot out of shots.csv or record it again")
    if text is None:
        return None
    lines = text.splitlines()
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        faults.add(file, None, "is empty; a trace starts with `time_s,force_n,position_m`")
        return None
    names = [name.strip() for name in lines[0].split(",")]
    if not _check_names(file, names, columns, faults):
        return None
    if len(lines) == 1:
        faults.add(file, 1, "has no samples; take the shot out of shots.csv or record it again")
        return None
    table = _numbers(file, lines, len(names), faults)
    if table is None:
        return None
    return _channels(file, names, columns, table, faults)


def _check_names(file: Path, names: list[str], columns: dict[str, str], faults: Faults) -> bool:
    known_columns = ["time_s", *columns.values()]
    noted = len(faults)
    if "time_s" not in names:
        faults.add(
            file, 1, f"no column time_s in `{','.join(names)}`; known columns: {', '.join(known_columns)}"
        )
    for column, name in enumerate(names):
        if name not in known_columns:
            faults.add(file, 1, f"unknown column {name!r}; known columns: {', '.join(known_columns)}")
        elif name in names[:column]:
            faults.add(file, 1, f"column {name!r} appears twice; keep one")
    if len(faults) == noted and len(names) == 1:
        faults.add(file, 1, f"has no channel; add one of {', '.join(columns.values())}")
    return len(faults) == noted


def _numbers(file: Path, lines: list[str], width: int, faults: Faults) -> Samples | None:
    """Table of the samples, shape (n, width), nan where a cell is empty."""
    body = lines[1:]
    commas = width - 1
    ragged = [row for row, line in enumerate(body, 2) if line.count(",") != commas]
    if ragged:
        for row in ragged[:MAX_FAULTS_PER_TRACE]:
            line = lines[row - 1]
            what = (
                f"{line.count(',') + 1} cells where the header has {width}"
                if line.strip()
                else "a blank line"
            )
            faults.add(file, row, f"{what}; leave a cell empty where a channel was not sampled")
        _report_further(file, len(ragged), faults)
        return None
    joined = ",".join(body)
    cells = joined.split(",")
    try:
        table = np.fromiter(map(float, cells), dtype=np.float64, count=len(cells))
    except ValueError:
        table = None
    # An underscore would be read as a thousands sign of Python source, which a trace does not have.
    if table is not None and (np.abs(table) < LARGEST).all() and "_" not in joined:
        return table.reshape(-1, width)
    return _parse_cells(file, cells, width, faults)


def _parse_cells(file: Path, cells: list[str], width: int, faults: Faults) -> Samples | None:
    table = np.full(len(cells), np.nan)
    bad = []
    for place, cell in enumerate(cells):
        text = cell.strip()
        if not text:
            continue
        try:
            table[place] = float(text)
        except ValueError:
            bad.append(place)
            continue
        if not abs(table[place]) < LARGEST or "_" in text:
            bad.append(place)
    for place in bad[:MAX_FAULTS_PER_TRACE]:
        faults.add(
            file,
            place // width + 2,
            f"{cells[place].strip()!r} is not a finite number; leave the cell empty where there is no sample",
        )
    _report_further(file, len(bad), faults)
    return None if bad else table.reshape(-1, width)


def _channels(
    file: Path, names: list[str], columns: dict[str, str], table: Samples, faults: Faults
) -> dict[str, tuple[Samples, Samples]] | None:
    time = table[:, names.index("time_s")]
    noted = len(faults)
    untimed = np.flatnonzero(np.isnan(time))
    # A comparison with nan is false, so a missing time is not reported a second time as a step back.
    backward = np.flatnonzero(time[1:] <= time[:-1]) + 1
    for row in untimed[:MAX_FAULTS_PER_TRACE]:
        faults.add(file, int(row) + 2, "time_s is empty; every row needs its time")
    for row in backward[:MAX_FAULTS_PER_TRACE]:
        text = f"time_s does not increase: {time[row]:.9g} after {time[row - 1]:.9g}; sort or remove the row"
        faults.add(file, int(row) + 2, text)
    _report_further(file, max(len(untimed), len(backward)), faults)
    if len(faults) > noted:
        return None
    channels = {}
    for sensor, name in columns.items():
        if name not in names:
            continue
        values = table[:, names.index(name)]
        sampled = np.isfinite(values)
        if not sampled.any():
            faults.add(file, 1, f"column {name} has no sample at all; take the column out")
            return None
        channels[sensor] = (np.ascontiguousarray(time[sampled]), np.ascontiguousarray(values[sampled]))
    return channels


def _report_further(file: Path, found: int, faults: Faults) -> None:
    if found > MAX_FAULTS_PER_TRACE:
        faults.add(file, None, f"the same in {found - MAX_FAULTS_PER_TRACE} more rows")
