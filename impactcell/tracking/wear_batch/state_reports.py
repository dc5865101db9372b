"""The tracker's state in the words of `impactcell.records`."""

import math
from dataclasses import replace

from impactcell.records import BatchState, Evidence, Quality, WearState
from impactcell.tracking.wear_batch import batch_filter as batches
from impactcell.tracking.wear_batch import run_length_bank as banks
from impactcell.tracking.wear_batch import wear_filter, wear_report
from impactcell.tracking.wear_batch.settings import BatchKnowledge, TrackerSettings
from impactcell.tracking.wear_batch.state import (
    ChangePoint,
    FrictionObservation,
    TrackerState,
    TrackingResult,
)


def empty_result(
    settings: TrackerSettings, state: TrackerState, reading: FrictionObservation, notes: list[str]
) -> TrackingResult:
    """Outcome of a cycle before the first usable one."""
    nan, reason = math.nan, "; ".join(notes)
    none = WearState(nan, nan, nan, nan, settings.wear_limit, nan, nan, nan, nan, Quality.BAD, reason)
    batch = BatchState(reading.batch_id or "", nan, nan, nan, nan, 0, Quality.BAD, reason)
    return TrackingResult(
        state, none, batch, None, expected=False, innovation=nan, used=False, notes=tuple(notes)
    )


def tracking_result(
    settings: TrackerSettings,
    state: TrackerState,
    reading: FrictionObservation,
    notes: list[str],
    *,
    used: bool,
    shift: ChangePoint | None = None,
    innovation: float = math.nan,
    expected: bool = False,
) -> TrackingResult:
    """Outcome of a cycle: by the filter where the batch is known, else by the bank."""
    reason = "; ".join(notes)
    quality = Quality.GOOD if used and not notes else Quality.UNCERTAIN
    if state.filter is not None and settings.batch is BatchKnowledge.KNOWN and reading.batch_id is not None:
        level, slope, covariance, offset, offset_std = _filter_moments(state.filter)
    else:
        level, slope, covariance, offset, offset_std = _bank_moments(state)
    state = _refine_change_point(state)
    walks = (state.level_variance, state.slope_variance)
    published = wear_report.wear_state(level, slope, covariance, walks, settings.wear_limit, quality, reason)
    last = state.shift
    learning = batches.reason_not_ready(state)
    batch = BatchState(
        reading.batch_id or state.batch_id or "",
        offset,
        offset_std,
        math.nan if last is None else last.size,
        math.nan if last is None else last.size_std,
        0 if last is None else state.clock.number(last.cycle),
        Quality.UNCERTAIN if learning else quality,
        "; ".join([*notes, *([learning] if learning else [])]),
    )
    evidence = None if shift is None else _evidence(settings, state, shift)
    return TrackingResult(state, published, batch, evidence, expected, innovation, used, tuple(notes))


def _filter_moments(
    known: wear_filter.WearFilter,
) -> tuple[float, float, tuple[float, float, float], float, float]:
    spread = known.covariance
    offset, offset_std = wear_filter.offset(known, known.current)
    covariance = (float(spread[0, 0]), float(spread[0, 1]), float(spread[1, 1]))
    return float(known.mean[0]), float(known.mean[1]), covariance, offset, offset_std


def _bank_moments(state: TrackerState) -> tuple[float, float, tuple[float, float, float], float, float]:
    """Level is total minus offset: friction as if the first batch were still there."""
    mean, full = banks.moments(state.bank)
    covariance = (
        float(full[0, 0] - 2.0 * full[0, 2] + full[2, 2]),
        float(full[0, 1] - full[2, 1]),
        float(full[1, 1]),
    )
    offset_std = math.sqrt(max(float(full[2, 2]), 0.0))
    return float(mean[0] - mean[2]), float(mean[1]), covariance, float(mean[2]), offset_std


def _refine_change_point(state: TrackerState) -> TrackerState:
    """Let the cycles since say more of the bank's last shift: when it was and how large."""
    if state.shift is None or state.shift.found_at != state.accepted:
        return state
    cycle, size, std = banks.locate_change_point(state.bank, state.accepted_before, state.accepted)
    return replace(state, shift=replace(state.shift, cycle=cycle, size=size, size_std=std))


def _evidence(settings: TrackerSettings, state: TrackerState, shift: ChangePoint) -> Evidence:
    return Evidence(
        shift.statistic,
        shift.threshold,
        state.clock.number(shift.cycle),
        shift.size,
        shift.size_std,
        settings.false_alarm_cycles,
        settings.false_alarm_cycles * state.clock.period_s / 86_400.0,
    )
