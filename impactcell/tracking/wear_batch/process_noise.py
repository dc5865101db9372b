"""The tracker's process noise: commissioned from the first cycles, adapted later by the innovations."""

from dataclasses import replace

from impactcell.tracking.wear_batch import (
    batch_change_detection,
    noise_identification,
    noise_scale,
)
from impactcell.tracking.wear_batch.noise_identification import CommissioningRecord
from impactcell.tracking.wear_batch.process_noise_adaptation import adapt_process_noise
from impactcell.tracking.wear_batch.settings import TrackerSettings
from impactcell.tracking.wear_batch.state import TrackerState, UsableCycle


def update_process_noise(
    settings: TrackerSettings, state: TrackerState, cycle: UsableCycle, factor: float
) -> tuple[TrackerState, list[str]]:
    """Commission the process noise from the first cycles, later multiply it by `factor`; say what changed."""
    state, notes = _adapted(state, factor)
    if state.commissioning is None:
        return state, notes
    record = noise_identification.append_cycle(state.commissioning, cycle, cycle.observation.batch_id)
    cycles = len(record.rows)
    is_ended = cycles >= settings.commissioning_cycles
    identifies = is_ended or cycles in noise_identification.IDENTIFIED_AT
    state = replace(state, commissioning=None if is_ended else record)
    if cycles in noise_identification.REFITTED_AT:
        values, stds = record.rows[:, noise_identification.VALUE], record.rows[:, noise_identification.STD]
        state = replace(state, noise=noise_scale.refit(state.noise, values, stds))
    elif not identifies:
        return state, notes
    return _replayed(settings, state, record, identifies=identifies), notes


def _adapted(state: TrackerState, factor: float) -> tuple[TrackerState, list[str]]:
    if factor == 1.0:
        return state, []
    level = adapt_process_noise(state.level_variance, factor, noise_scale.usual_variance(state.noise))
    if level == state.level_variance:
        return state, []
    moved = "raised" if factor > 1.0 else "lowered"
    return replace(state, level_variance=level), [f"innovations are correlated: process noise {moved}"]


def _replayed(
    settings: TrackerSettings, state: TrackerState, record: CommissioningRecord, *, identifies: bool
) -> TrackerState:
    """Go over the first cycles again where the scale of the noise, or the random walks, are other by now."""
    stds = record.rows[:, noise_identification.STD]
    together, apart = noise_scale.scale_change(state.noise, state.replayed_noise, stds)
    is_rescaled = together > noise_identification.RESCALED or apart > noise_identification.RESHAPED
    if not (identifies or is_rescaled):
        return state
    walks = noise_identification.RandomWalks(settings.level_noise, settings.slope_noise)
    if identifies:
        walks = noise_identification.identify_random_walks(settings, record, state.noise)
    unit = noise_scale.usual_variance(state.noise)
    level, slope = walks.level**2 * unit, walks.slope**2 * unit
    if level == state.level_variance and slope == state.slope_variance and not is_rescaled:
        return state
    again = noise_identification.replay_bank(settings, record, state.noise, walks)
    known = state.filter
    if known is not None:
        known = noise_identification.replay_filter(settings, record, state.noise, walks)
    return replace(
        state,
        bank=again.bank,
        change_point=batch_change_detection.refined_change_point(state, again.bank),
        outliers=again.outliers,
        filter=known,
        level_variance=level,
        slope_variance=slope,
        replayed_noise=state.noise,
    )
