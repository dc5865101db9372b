"""`impactcell track`: replay a friction series through the tracker and its alarms."""

import csv
import json
import math
import sys
from pathlib import Path

from impactcell.cell.series_replay import TrackedSeries, replay
from impactcell.errors import SeriesError
from impactcell.records.uncertainty import plus_minus
from impactcell.tracking.wear_batch import BatchKnowledge, FrictionObservation, TrackerSettings

COLUMNS = ("cycle", "mu_s", "mu_s_std", "batch")
FEWEST_CYCLES = 2
"""Cycles that a rate of change takes."""


def track(
    series: Path, batch: str | None = None, limit: float | None = None, *, as_json: bool = False
) -> None:
    """Replay a series `cycle,mu_s,mu_s_std[,batch]` and print wear, rate and alarms.

    Parameters
    ----------
    batch : "known", "unknown" or None
        Whether the batch column is believed; None believes it where there is one.
    limit : float or None
        mu_s at which the surface is worn.

    Raises
    ------
    SeriesError
        A file that cannot be read, with file and line.
    """
    readings, has_batch = read_series(series)
    if batch not in (None, "known", "unknown"):
        raise SeriesError(f"--batch {batch}: say known or unknown")
    knowledge = BatchKnowledge(batch) if batch else None
    if knowledge is BatchKnowledge.KNOWN and not has_batch:
        raise SeriesError(
            f"{series}:1: --batch known needs a column `batch`; leave the option out, or add it"
        )
    if knowledge is None:
        knowledge = BatchKnowledge.KNOWN if has_batch else BatchKnowledge.UNKNOWN
    settings = TrackerSettings(wear_limit=math.inf if limit is None else limit, batch=knowledge)
    tracked = replay(settings, readings)
    if tracked.used < FEWEST_CYCLES:
        why = f"; {tracked.notes[0][1]}" if tracked.notes else ""
        raise SeriesError(
            f"{series}: only {tracked.used} of {len(readings)} cycles can be used, "
            f"it takes {FEWEST_CYCLES}{why}"
        )
    text = json.dumps(_as_json(tracked)) if as_json else _as_text(tracked)
    sys.stdout.write(text + "\n")


def read_series(path: Path) -> tuple[list[FrictionObservation], bool]:
    """Read a series; also tell whether it has a column `batch`.

    Raises
    ------
    SeriesError
        No such file, no header, a column missing or twice, a cell that is no number.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.reader(file))
    except OSError as error:
        raise SeriesError(f"{path}: cannot be read: {error.strerror}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise SeriesError(f"{path}: not a CSV file: {error}") from error
    if not rows:
        raise SeriesError(f"{path}:1: empty; the first line is to be cycle,mu_s,mu_s_std[,batch]")
    header = [name.strip() for name in rows[0]]
    if len(header) == 1 and ";" in header[0]:
        raise SeriesError(f"{path}:1: is separated by `;`; write it with `,` and decimal points")
    for name in ("cycle", "mu_s"):
        if name not in header:
            raise SeriesError(
                f"{path}:1: no column `{name}`; the first line is to be cycle,mu_s,mu_s_std[,batch]"
            )
    for name in COLUMNS:
        if header.count(name) > 1:
            raise SeriesError(f"{path}:1: column `{name}` is there {header.count(name)} times; keep one")
    readings = []
    for line, row in enumerate(rows[1:], start=2):
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(header):
            raise SeriesError(f"{path}:{line}: {len(row)} cells, but the header has {len(header)}")
        cells = dict(zip(header, (cell.strip() for cell in row), strict=True))
        readings.append(_reading(path, line, cells))
    if not readings:
        raise SeriesError(f"{path}:2: no cycles after the header")
    return readings, "batch" in header


def _reading(path: Path, line: int, cells: dict[str, str]) -> FrictionObservation:
    try:
        number = float(cells["cycle"])
        cycle = int(number)
    except (ValueError, OverflowError):
        raise SeriesError(f"{path}:{line}: cycle `{cells['cycle']}` is not a whole number") from None
    if cycle != number or cycle < 0:
        raise SeriesError(f"{path}:{line}: cycle `{cells['cycle']}` is not a whole number from 0 on")
    mu_s, std = (_number(path, line, name, cells.get(name, "")) for name in ("mu_s", "mu_s_std"))
    return FrictionObservation(cycle, mu_s, std, batch_id=cells.get("batch") or None)


def _number(path: Path, line: int, name: str, cell: str) -> float:
    """Read a number; an empty cell is a missing one."""
    if not cell:
        return math.nan
    try:
        number = float(cell)
    except ValueError:
        raise SeriesError(
            f"{path}:{line}: {name} `{cell}` is not a number; leave it empty if missing"
        ) from None
    if name == "mu_s_std" and not math.isfinite(number):
        raise SeriesError(
            f"{path}:{line}: {name} `{cell}` is no standard deviation; leave it empty if it is not known"
        )
    return number


def _as_json(series: TrackedSeries) -> dict[str, object]:
    wear, batch = series.wear, series.batch
    return {
        "cycles": series.used,
        "slope_per_cycle": wear.rate_per_cycle,
        "slope_std": wear.rate_std,
        "level": wear.level,
        "level_std": wear.level_std,
        "batch_offset": batch.offset,
        "batch_offset_std": batch.offset_std,
        "cycles_to_limit": _finite(wear.cycles_to_limit),
        "cycles_to_limit_low": _finite(wear.cycles_to_limit_low),
        "cycles_to_limit_high": _finite(wear.cycles_to_limit_high),
        "alarms": [
            {
                "alarm": r.alarm,
                "cycle": r.cycle,
                "change_cycle": r.evidence.change_cycle,
                "size": r.evidence.size,
                "size_std": r.evidence.size_std,
                "statistic": r.evidence.statistic,
                "threshold": r.evidence.threshold,
                "false_alarm_cycles": _finite(r.evidence.false_alarm_cycles),
            }
            for r in series.alarms
        ],
        "notes": [{"cycle": cycle, "note": note} for cycle, note in series.notes],
    }


def _finite(value: float) -> float | None:
    """JSON has no infinity: null says not reached, or no such figure."""
    return value if math.isfinite(value) else None


def _cycles(count: float) -> str:
    return f"{count:.0f}" if math.isfinite(count) else "never"


def _as_text(series: TrackedSeries) -> str:
    wear = series.wear
    rate = plus_minus(1e3 * wear.rate_per_cycle, 1e3 * wear.rate_std, "+.6f", ".6f")
    lines = [
        f"{series.used} cycles used",
        f"level   {plus_minus(wear.level, wear.level_std, '.5f')} (95 %, as all ± below)",
        f"wear    {rate} per 1000 cycles",
    ]
    if math.isfinite(wear.limit):
        left, low, high = map(
            _cycles, (wear.cycles_to_limit, wear.cycles_to_limit_low, wear.cycles_to_limit_high)
        )
        lines.append(f"limit   {wear.limit:g}, cycles to it: {left}, 95 %: {low} .. {high}")
    for r in series.alarms:
        e = r.evidence
        changed = f"changed at {e.change_cycle}, " if e.change_cycle else ""
        lines.append(
            f"{r.alarm} at cycle {r.cycle}: {changed}{plus_minus(e.size, e.size_std, '+.5f', '.5f')}"
        )
    lines.extend(f"cycle {cycle}: {note}" for cycle, note in series.notes)
    return "\n".join(lines)
