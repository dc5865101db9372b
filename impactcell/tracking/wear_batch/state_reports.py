"""The tracker's state in the words of `impactcell.records`."""

import math
from dataclasses import dataclass

from impactcell.records import LARGEST_STATISTIC, BatchState, Evidence, Quality, Samples, WearState
from impactcell.tracking.wear_batch import (
    batch_change_detection,
    noise_scale,
    rate_changes,
    run_length_bank,
    wear_blocks,
    wear_filter,
    wear_report,
)
from impactcell.tracking.wear_batch.settings import BatchKnowledge, TrackerSettings
from impactcell.tracking.wear_batch.state import (
    ChangePoint,
    FrictionObservation,
    TrackerState,
    TrackingResult,
)
from impactcell.tracking.wear_batch.wear_report import WearMoments

SECONDS_A_DAY = 86_400.0
"""Seconds."""


@dataclass(frozen=True, slots=True)
class CycleOutcome:
    """What became of one cycle; `notes`, `used`, `innovation` and `expected` as in `TrackingResult`."""

    notes: list[str]
    used: bool
    change: ChangePoint | None = None
    innovation: float = math.nan
    expected: bool = False


def empty_result(
    settings: TrackerSettings, state: TrackerState, observation: FrictionObservation, outcome: CycleOutcome
) -> TrackingResult:
    """Report a cycle before the first usable one."""
    nan, reason = math.nan, "; ".join(outcome.notes)
    wear = WearState(nan, nan, nan, nan, settings.wear_limit, nan, nan, nan, nan, Quality.BAD, reason)
    batch = BatchState(observation.batch_id or "", nan, nan, nan, nan, 0, Quality.BAD, reason)
    return TrackingResult(
        state,
        wear,
        batch,
        None,
        expected=False,
        horizon=nan,
        probability_at_horizon=nan,
        innovation=nan,
        used=False,
        notes=tuple(outcome.notes),
    )


def tracking_result(
    settings: TrackerSettings, state: TrackerState, observation: FrictionObservation, outcome: CycleOutcome
) -> TrackingResult:
    """Report a cycle: by the filter where the batch is known, else by the bank.

    What makes mu_s uncertain, a wrong scale for one, shifts all estimates alike, which their scatter does not
    show: the level is no better than the estimate that it follows.
    """
    notes = outcome.notes
    probability = None
    quality = Quality.GOOD if outcome.used and not notes else Quality.UNCERTAIN
    if state.filter is not None and _is_known(settings, observation):
        moments, offset, offset_std = _filter_moments(state.filter)
    else:
        blocks, index = state.wear_blocks, state.clock.last
        bank, is_bent = _believed_bank(settings, state)
        moments, offset, offset_std = _bank_moments(bank)
        if blocks is not None and len(blocks.slopes) and not is_bent:
            total = moments.level + offset
            moments = wear_blocks.moments(blocks, index)
            offset = total - moments.level
            if math.isfinite(settings.wear_limit):
                probability = wear_blocks.probability_above(blocks, index, settings.wear_limit)
    walks = _walks_ahead(state, moments)
    doubts = [*notes, *([observation.doubt] if observation.doubt else [])]
    wear = wear_report.forecast(
        moments,
        walks,
        settings.wear_limit,
        Quality.UNCERTAIN if doubts else quality,
        "; ".join(doubts),
        probability,
        math.sqrt(state.common_variance),
    )
    change = state.change_point
    not_ready = batch_change_detection.reason_not_ready(state)
    batch = BatchState(
        observation.batch_id or state.batch_id or "",
        offset,
        offset_std,
        math.nan if change is None else change.size,
        math.nan if change is None else change.size_std,
        0 if change is None else state.clock.number(change.cycle),
        Quality.UNCERTAIN if not_ready else quality,
        "; ".join([*notes, *([not_ready] if not_ready else [])]),
    )
    return TrackingResult(
        state,
        wear,
        batch,
        None if outcome.change is None else _evidence(settings, state, outcome.change),
        outcome.expected,
        *_at_horizon(settings, state, moments, walks),
        outcome.innovation,
        outcome.used,
        tuple(notes),
    )


def present_friction(
    settings: TrackerSettings, state: TrackerState, observation: FrictionObservation
) -> tuple[float, float]:
    """Friction of the present batch after a cycle: level and offset together, and the standard deviation."""
    if len(state.bank) == 0:
        return math.nan, math.nan
    if state.filter is not None and _is_known(settings, observation):
        return wear_filter.friction(state.filter)
    known = run_length_bank.wear_moments(_believed_bank(settings, state)[0])
    return known.total, math.sqrt(max(known.total_variance, 0.0))


def _is_known(settings: TrackerSettings, observation: FrictionObservation) -> bool:
    """Whether somebody says, and is believed, of which batch a cycle is."""
    return settings.batch is BatchKnowledge.KNOWN and observation.batch_id is not None


def _believed_bank(settings: TrackerSettings, state: TrackerState) -> tuple[Samples, bool]:
    """Give the hypotheses that are believed, and whether wear has another rate by them."""
    prior = _slope_prior(settings, state)
    is_bent = len(state.rates) > 0 and rate_changes.has_rate_changed(state.bank, state.rates, prior)
    return rate_changes.mixture(state.bank, state.rates, prior) if is_bent else state.bank, is_bent


def _at_horizon(
    settings: TrackerSettings, state: TrackerState, moments: WearMoments, walks: tuple[float, float]
) -> tuple[float, float]:
    """Give the cycles that are looked ahead, no more than have been seen, and P(level > limit) then."""
    if not math.isfinite(settings.wear_limit):
        return math.nan, math.nan
    ahead = wear_report.extrapolation(moments, walks, settings.wear_limit)
    prior = _slope_prior(settings, state)
    horizon = min(settings.horizon_cycles, float(state.clock.last - state.first_index))
    return horizon, wear_report.probability_after(ahead, horizon, prior)


def _walks_ahead(state: TrackerState, moments: WearMoments) -> tuple[float, float]:
    """Process variances of level and slope a cycle, as far as wear has been followed at its present rate."""
    begun = state.first_index if state.rate_change is None else state.rate_change.cycle
    walks = state.level_variance, state.slope_variance
    return wear_report.walks_ahead(moments, walks, float(state.clock.last - begun))


def _slope_prior(settings: TrackerSettings, state: TrackerState) -> float:
    """Prior variance of the slope."""
    return settings.slope_std**2 * noise_scale.usual_variance(state.noise)


def _filter_moments(known: wear_filter.WearFilter) -> tuple[WearMoments, float, float]:
    mean, covariance = known.mean, known.covariance
    moments = WearMoments(
        float(mean[0]),
        float(mean[1]),
        float(covariance[0, 0]),
        float(covariance[0, 1]),
        float(covariance[1, 1]),
    )
    return moments, *wear_filter.offset(known, known.current)


def _bank_moments(bank: Samples) -> tuple[WearMoments, float, float]:
    """Level is total minus offset: friction as if the first batch were still there."""
    known = run_length_bank.wear_moments(bank)
    moments = WearMoments(
        known.total - known.offset,
        known.slope,
        known.total_variance - 2.0 * known.total_offset + known.offset_variance,
        known.total_slope - known.slope_offset,
        known.slope_variance,
    )
    return moments, known.offset, math.sqrt(max(known.offset_variance, 0.0))


def _evidence(settings: TrackerSettings, state: TrackerState, change: ChangePoint) -> Evidence:
    return Evidence(
        min(change.statistic, LARGEST_STATISTIC),
        change.threshold,
        state.clock.number(change.cycle),
        change.size,
        change.size_std,
        settings.false_alarm_cycles,
        settings.false_alarm_cycles * state.clock.period_s / SECONDS_A_DAY,
    )
