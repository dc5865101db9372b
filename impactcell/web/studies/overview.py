"""What a campaign holds, and what its shots' friction was, at a glance and at little cost."""

import csv
import math
from collections import Counter
from itertools import islice
from pathlib import Path
from statistics import fmean, stdev
from typing import Any, Final

from impactcell.campaign.faults import Faults
from impactcell.errors import CampaignError

MAX_ROWS: Final = 5000
"""Shots that are looked at."""
UNITS: Final = {"s": "s", "n": "N", "m": "m", "kg": "kg", "per_min": "mm/min", "mm_per_min": "mm/min"}
"""Ends of column names in a campaign, and the unit that they stand for."""
SHOWN_COLUMNS: Final = ("shot", "mu_s", "mu_s_std", "mu_k", "mu_k_std", "quality", "reason")
"""What the page shows of each shot's friction."""


def campaign_overview(directory: Path) -> dict[str, Any]:
    """Count shots and say which columns, with which units, a campaign has.

    Raises
    ------
    CampaignError
        It has no table of shots that can be read, or one whose rows are not as wide as its header.
    """
    if not directory.exists():
        return {}
    shots = _rows(directory / "shots.csv")
    traces = sorted((directory / "traces").glob("*.csv"))
    channels: Counter[str] = Counter()
    for trace in traces[:MAX_ROWS]:
        channels.update(_header(trace))
    masses, velocities = _range(shots, "mass_kg"), _range(shots, "velocity_mm_per_min")
    return {
        "shots": len(shots),
        "traces": len(traces),
        "channels": [{"name": name, "unit": unit_of(name), "shots": n} for name, n in channels.items()],
        "covariates": [{"name": name, "unit": unit_of(name)} for name in (shots[0] if shots else {})],
        "mass_kg": masses,
        "velocity_mm_per_min": velocities,
    }


def unit_of(column: str) -> str:
    """Read the unit off a column's name.

    >>> unit_of("velocity_mm_per_min"), unit_of("force_n"), unit_of("batch")
    ('mm/min', 'N', '')
    """
    for suffix in sorted(UNITS, key=len, reverse=True):
        if column.endswith(f"_{suffix}"):
            return UNITS[suffix]
    return ""


def friction_overview(table: Path) -> dict[str, Any]:
    """Average what `impactcell estimate` wrote."""
    rows = _rows(table)
    return {
        "shots": len(rows),
        "mu_s": _mean(rows, "mu_s"),
        "mu_k": _mean(rows, "mu_k"),
        "good": sum(row.get("quality") == "good" for row in rows),
        "rows": [{name: row.get(name, "") for name in SHOWN_COLUMNS} for row in rows[:200]],
    }


def _rows(path: Path) -> list[dict[str, str]]:
    rows, faults = [], Faults(Path(path.name))
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            filled = (row for row in reader if any(cell.strip() for cell in row))
            names = [name.strip() for name in next(filled, [])]
            for row in islice(filled, MAX_ROWS):
                if len(row) != len(names):  # in the words of what reads it later
                    told = f"{len(row)} cells where the header has {len(names)}"
                    faults.add(Path(path.name), reader.line_num, told)
                rows.append(dict(zip(names, row, strict=False)))
    except (OSError, ValueError, csv.Error) as error:
        raise CampaignError(f"{path.name}: cannot be read ({error})") from error
    faults.raise_any()
    return rows


def _header(path: Path) -> list[str]:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            return next(csv.reader([file.readline(10_000)]), [])
    except (OSError, ValueError, csv.Error):
        return []


def _numbers(rows: list[dict[str, str]], column: str) -> list[float]:
    values = []
    for row in rows:
        try:
            value = float(row.get(column) or "nan")
        except ValueError:
            continue
        if math.isfinite(value):
            values.append(value)
    return values


def _range(rows: list[dict[str, str]], column: str) -> list[float]:
    values = _numbers(rows, column)
    return [min(values), max(values)] if values else []


def _mean(rows: list[dict[str, str]], column: str) -> dict[str, float] | None:
    values = _numbers(rows, column)
    if not values:
        return None
    return {"mean": fmean(values), "spread": stdev(values) if len(values) > 1 else 0.0, "n": len(values)}
