"""The early warning of wear, and the cycles left with their interval, beside an oracle; see `_track`."""

import math
from collections.abc import Iterable, Sequence

import numpy as np
from scipy.stats import binomtest

from impactcell import TrackedSeries
from impactcell.alarms.rules import wear_warning
from impactcell.tracking.wear_batch import TrackerSettings, wear_report
from impactcell.tracking.wear_batch.wear_report import WearMoments
from tests.benchmarks import _streams
from tests.benchmarks.table import Table

HORIZON = TrackerSettings().horizon_cycles
SETTINGS = wear_warning.RULE.settings
SLOPE_STD = TrackerSettings().slope_std  # the oracle's prior of the slope: ours, and mixed as ours
REMAINING = (3000, 1500, 500)  # cycles truly left at which the interval is asked
WALKS = (0.0, 0.0)
Known = Sequence[tuple[np.ndarray, np.ndarray]]


def share(of: np.ndarray) -> str:
    if not len(of):
        return "none"
    interval = binomtest(int(of.sum()), len(of)).proportion_ci(method="wilson")
    return f"{100 * of.mean():.1f} % ({100 * interval.low:.1f}-{100 * interval.high:.1f})"


def first_sure(sure: Iterable[bool], delay: int) -> float:
    """Cycle at which somebody has been sure for longer than an alarm's delay; inf if never."""
    held = 0
    for t, is_sure in enumerate(sure):
        held = held + 1 if is_sure else 0
        if held > delay:
            return float(t)
    return math.inf


def outcome(series: TrackedSeries, known: Known, limit: float) -> dict:
    """Warnings and intervals of one stream, ours and the oracle's; `limit` in sd."""
    crossed = limit / _streams.SLOPE
    asked = [round(crossed) - left for left in REMAINING]
    return {
        "warned": [alarm.cycle for alarm in series.alarms if alarm.alarm == wear_warning.NAME],
        "oracle_warned": first_sure(
            (_sure(t, each, limit) for t, each in enumerate(known)), SETTINGS.on_delay
        ),
        "left": [series.cycles_to_limit[at].tolist() if at >= 0 else None for at in asked],
        "oracle_left": [_left(*known[at], limit) if at >= 0 else None for at in asked],
    }


def _moments(mean: np.ndarray, covariance: np.ndarray) -> WearMoments:
    return WearMoments(mean[0], mean[1], covariance[0, 0], covariance[0, 1], covariance[1, 1])


def _sure(seen: int, known: tuple[np.ndarray, np.ndarray], limit: float) -> bool:
    ahead = wear_report.extrapolation(_moments(*known), WALKS, limit)
    horizon = min(HORIZON, float(seen))
    return wear_report.probability_after(ahead, horizon, SLOPE_STD**2) > SETTINGS.activate_above


def _left(mean: np.ndarray, covariance: np.ndarray, limit: float) -> list[float]:
    wear = wear_report.forecast(_moments(mean, covariance), WALKS, limit)
    return [wear.cycles_to_limit, wear.cycles_to_limit_low, wear.cycles_to_limit_high]


def table(done: list[dict], crossed: np.ndarray) -> Table:
    """Table of streams that are done, with the cycles at which each crossed its limit."""
    columns = []
    for warned, left in (
        ([d["warned"][0] if d["warned"] else math.inf for d in done], [d["left"] for d in done]),
        ([d["oracle_warned"] for d in done], [d["oracle_left"] for d in done]),
    ):
        ahead = crossed - np.array(warned, dtype=float)
        right = ahead[(ahead <= HORIZON) & (ahead > 0.0)]
        column = [
            share(np.isneginf(ahead)),
            share(ahead <= 0.0),
            share(ahead > HORIZON),
            f"{np.median(ahead):.0f}" if len(ahead) else "none",
            f"{np.median(right):.0f} of {len(right)}" if len(right) else "none came",
        ]
        for place, remaining in enumerate(REMAINING):
            asked = np.array([each[place] for each in left if each[place]])
            covered = (asked[:, 1] <= remaining) & (asked[:, 2] >= remaining)
            width = np.median(asked[:, 2] - asked[:, 1])
            column.append(f"{share(covered)}, width {width:.0f}")
        columns.append(column)
    names = [
        "never came before the stream ended",
        "not before the limit was passed",
        f"limit not passed within {HORIZON:.0f} cycles of it",
        "cycles before the limit is passed, median of all",
        "cycles before, median of those in time",
        *[f"interval of cycles left holds them, {left} truly left" for left in REMAINING],
    ]
    bars = ["", "", f"{100 * (1 - SETTINGS.activate_above):.0f} %", "", "", *["95 %"] * len(REMAINING)]
    note = (
        f"{len(done)} streams as above; the service's own rule, which warns where P(level above limit in "
        f"{HORIZON:.0f} cycles) passes {100 * SETTINGS.activate_above:g} %, the oracle at the same. "
        "Intervals are asked where the limit is so many cycles off, in streams that have begun by then; of "
        "their width the median."
    )
    return Table(
        "Early warning of wear through `track`, batch unknown",
        ["what", "bar", "ours", "oracle"],
        [list(row) for row in zip(names, bars, *columns, strict=True)],
        note,
    )
