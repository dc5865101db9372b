"""`impactcell track`: replay a friction series through the tracker and its alarms."""

import json
import math
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from impactcell.alarms.rules import batch_shift, wear_limit
from impactcell.cell.series_replay import RaisedAlarm, TrackedSeries, replay
from impactcell.cli.series_file import COLUMNS, SeriesFile, read_series
from impactcell.errors import SeriesError
from impactcell.process.console import print_note
from impactcell.records.uncertainty import TOLD_STDS, plus_minus, told_cycles_left
from impactcell.settings.plausible_tap import FRICTION
from impactcell.tracking.wear_batch import BatchKnowledge, TrackerSettings
from impactcell.tracking.wear_batch.input_validation import LARGEST_FRICTION, SMALLEST_STD
from impactcell.tracking.wear_batch.noise_scale import GUESSED_RELATIVE_STD

FIGURES: Final = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
"""Numbers in a note."""
FEWEST_CYCLES = 2
"""Cycles that a rate of change takes."""


def track(
    series: Path, batch: str | None = None, limit: float | None = None, *, as_json: bool = False
) -> None:
    """Replay a series `cycle,mu_s,mu_s_std[,batch]` and print wear, rate and alarms.

    A column `mu_s_common_std` says which part of mu_s_std all cycles share, as an error of the model's
    mu_k/mu_s: that is told of the level beside its own interval, which averages over cycles.

    Parameters
    ----------
    batch : "known", "unknown" or None
        Whether the batch column is believed; None believes it where there is one.
    limit : float or None
        mu_s at which the surface is worn.

    Raises
    ------
    SeriesError
        A file that cannot be read, with file and line; cycles that are not in their order; a limit that is
        no friction.
    """
    file = read_series(series)
    if batch not in (None, "known", "unknown"):
        raise SeriesError(f"--batch {batch}: say known or unknown")
    knowledge = BatchKnowledge(batch) if batch else None
    if knowledge is BatchKnowledge.KNOWN and not file.has_batch:
        raise SeriesError(
            f"{series}:1: --batch known needs a column `batch`; leave the option out, or add it"
        )
    if knowledge is None:
        knowledge = BatchKnowledge.KNOWN if file.has_batch else BatchKnowledge.UNKNOWN
    if limit is not None and not 0.0 < limit < math.inf:
        raise SeriesError(f"--limit {limit:g}: say the mu_s at which the surface is worn, 0.25 say")
    if limit is not None and limit > LARGEST_FRICTION:
        raise SeriesError(
            f"--limit {limit:g}: no surface reaches it, for a mu_s above {LARGEST_FRICTION:g} is not used; "
            f"say the mu_s at which it is worn, {0.01 * limit:g} if that was meant in %"
        )
    settings = TrackerSettings(wear_limit=math.inf if limit is None else limit, batch=knowledge)
    try:
        tracked = replay(settings, file.observations)
    except SeriesError as error:
        raise SeriesError(f"{series}: {error}") from error
    doubt = _doubt(file)
    if tracked.used < FEWEST_CYCLES:
        why = "".join(f"; {said}" for said in (*(note for _, note in tracked.notes[:1]), doubt) if said)
        raise SeriesError(
            f"{series}: only {tracked.used} of {len(file.observations)} cycles can be used, "
            f"it takes {FEWEST_CYCLES}{why}"
        )
    for note in file.notes:
        print_note(note)
    if zeros := _zero_stds(file):
        print_note(f"{series}: {zeros}")
    if file.unread:
        print_note(_unread(series, file))
    if all(math.isnan(observation.mu_s_std) for observation in file.observations):
        print_note(
            f"{series}: no standard deviations (`mu_s_std`): {100.0 * GUESSED_RELATIVE_STD:g} % of mu_s is "
            "taken, and learned from the scatter of the series; add them where they are known"
        )
    if doubt:
        print_note(f"{series}: mu_s: {doubt}")
    if limit is not None and (doubt := FRICTION.doubt(limit)):
        print_note(f"--limit: {doubt}")
    named = {seen.batch_id for seen in file.observations} - {None}
    is_told = knowledge is BatchKnowledge.KNOWN and len(named) > 1
    text = json.dumps(_as_json(tracked)) if as_json else _as_text(tracked, is_told=is_told)
    sys.stdout.write(text + "\n")


def _doubt(file: SeriesFile) -> str:
    """Say that the mu_s of a file are hardly meant, as those in %; empty where they may be."""
    given = [seen.mu_s for seen in file.observations if math.isfinite(seen.mu_s)]
    return FRICTION.doubt(float(np.median(given))) if given else ""


def _zero_stds(file: SeriesFile) -> str:
    """Tell the rows whose standard deviation is 0, which the tracker takes for none; empty without such."""
    zeros = [seen.cycle for seen in file.observations if seen.mu_s_std < SMALLEST_STD]
    if not zeros:
        return ""
    told = "1 row" if len(zeros) == 1 else f"{len(zeros)} rows"
    return (
        f"mu_s_std is 0 in {told} of {len(file.observations)}, the first at cycle {zeros[0]}: no estimate is "
        "so sure, it is taken for not stated there; leave it empty, or write what is known"
    )


def _unread(series: Path, file: SeriesFile) -> str:
    names, known = ", ".join(f"`{name}`" for name in file.unread), ", ".join(COLUMNS)
    return f"{series}: not read: {names}; what is read is called {known}"


def _as_json(series: TrackedSeries) -> dict[str, object]:
    wear, batch = series.wear, series.batch
    return {
        "cycles": series.used,
        "slope_per_cycle": wear.rate_per_cycle,
        "slope_std": wear.rate_std,
        "level": wear.level,
        "level_std": wear.level_std,
        "level_common_std": _finite(wear.level_common_std),
        "batch_offset": batch.offset,
        "batch_offset_std": batch.offset_std,
        "friction": series.friction,
        "friction_std": series.friction_std,
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
                "statistic": _finite(r.evidence.statistic),
                "threshold": r.evidence.threshold,
                "false_alarm_cycles": _finite(r.evidence.false_alarm_cycles),
                "withdrawn": r.withdrawn,
                "cleared_cycle": r.cleared_cycle,
                "may_be_renewed": r.may_be_renewed,
            }
            for r in series.alarms
        ],
        "notes": [{"cycle": cycle, "note": note} for cycle, note in series.notes],
    }


def _finite(value: float) -> float | None:
    """JSON has no infinity: null says not reached, or no such figure."""
    return value if math.isfinite(value) else None


def _as_text(series: TrackedSeries, *, is_told: bool) -> str:
    wear = series.wear
    has_other = is_told or _has_other_batch(series)
    alone = "" if has_other else "; no other was found"
    level = plus_minus(wear.level, wear.level_std, ".5f")
    rate = plus_minus(1e3 * wear.rate_per_cycle, 1e3 * wear.rate_std, "+.6f", ".6f")
    lines = [
        f"{series.used} cycles used",
        f"level   {level} (95 %, as all ± below): mu_s with the first batch{alone}",
        *_common_line(wear.level_common_std),
        *(_batch_lines(series) if has_other else []),
        f"wear    {rate} per 1000 cycles",
    ]
    if math.isfinite(wear.limit):
        left = wear.cycles_to_limit, wear.cycles_to_limit_low, wear.cycles_to_limit_high
        lines.append(f"limit   {wear.limit:g}, cycles to it: {told_cycles_left(*left, '{}, 95 %: {} .. {}')}")
    lines.extend(_alarm_line(raised, series) for raised in series.alarms)
    return "\n".join([*lines, *_note_lines(series.notes)])


def _common_line(common_std: float) -> list[str]:
    """Say what may be wrong in all cycles alike; nothing where no cycle says so."""
    if not common_std > 0.0:
        return []
    return [f"common  ± {TOLD_STDS * common_std:.5f} more: mu_s may be off by that in all cycles alike"]


def _has_other_batch(series: TrackedSeries) -> bool:
    """Whether a change of batch was found, or the present one is off by more than may be none."""
    batch = series.batch
    return bool(_shifts(series)) or abs(batch.offset) > TOLD_STDS * batch.offset_std


def _batch_lines(series: TrackedSeries) -> list[str]:
    """Say what mu_s is by now where that is not the level; nothing where the first batch is still there."""
    batch = series.batch
    if batch.offset == batch.offset_std == 0.0:
        return []
    offset = plus_minus(batch.offset, batch.offset_std, "+.5f", ".5f")
    now = plus_minus(series.friction, series.friction_std, ".5f")
    return [
        f"batch   {offset}: the present one beside the first",
        f"now     {now}: mu_s with the present batch",
    ]


def _alarm_line(raised: RaisedAlarm, series: TrackedSeries) -> str:
    evidence, begin = raised.evidence, f"{raised.alarm} at cycle {raised.cycle}: "
    if raised.alarm == batch_shift.NAME:
        size = plus_minus(evidence.size, evidence.size_std, "+.5f", ".5f")
        end = "; withdrawn, by the cycles since it may be no change" if raised.withdrawn else ""
        return f"{begin}changed at {evidence.change_cycle}, {size}{end}"
    passed = _passed(raised, series) if raised.alarm == wear_limit.NAME else ""
    off = plus_minus(abs(evidence.size), evidence.size_std, ".5f")
    side = "above" if evidence.size > 0.0 else "below"
    end = _renewal(series) if raised.may_be_renewed else _end(raised, series)
    return f"{begin}{passed}level {off} {side} the limit{end}"


def _renewal(series: TrackedSeries) -> str:
    """Say that friction is below the limit again, and how to see it so where the surface was renewed."""
    falls = [a for a in _shifts(series) if a.evidence.size < 0.0]
    when = f", at {falls[-1].evidence.change_cycle} say" if falls else ""
    return (
        f"; mu_s with the present batch is {series.friction:.5f}, below it: if the surface was "
        f"renewed{when}, track the cycles from there on alone"
    )


def _shifts(series: TrackedSeries) -> list[RaisedAlarm]:
    """Give the changes of batch that were found, and not withdrawn."""
    return [a for a in series.alarms if a.alarm == batch_shift.NAME and not a.withdrawn]


def _end(raised: RaisedAlarm, series: TrackedSeries) -> str:
    """Say since when a condition is over; not of a warning where what it warned of has come, and stands."""
    over = raised.cleared_cycle
    if over is None:
        return ""
    standing = [a for a in series.alarms if a.alarm == wear_limit.NAME and a.cleared_cycle is None]
    has_come = raised.alarm != wear_limit.NAME and any(alarm.cycle <= over for alarm in standing)
    return "" if has_come else f"; gone since cycle {over}"


def _passed(raised: RaisedAlarm, series: TrackedSeries) -> str:
    """Say when the limit was passed, where a level that was not above it has been seen before."""
    until = np.flatnonzero(series.cycle == raised.cycle)[-1] + 1
    if not (series.level[:until] <= series.wear.limit).any():
        return "passed before the first cycle, "
    return f"passed at about {raised.evidence.change_cycle}, "


def _note_lines(notes: Sequence[tuple[int, str]]) -> list[str]:
    """Give a line to each kind of note: of those alike but for their figures the last, with how many."""
    alike: dict[str, list[tuple[int, str]]] = {}
    for cycle, note in notes:
        alike.setdefault(FIGURES.sub("", note), []).append((cycle, note))
    lines = []
    for *others, (cycle, note) in alike.values():
        more = f" (and {len(others)} more like this, the first at cycle {others[0][0]})" if others else ""
        lines.append(f"cycle {cycle}: {note}{more}")
    return lines
