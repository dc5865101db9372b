"""One cycle of tracking: screen the reading, follow wear and batch, say what is believed afterwards."""

import math
from dataclasses import replace

from impactcell.records import Samples
from impactcell.tracking.wear_batch import batch_filter as batches
from impactcell.tracking.wear_batch import (
    input_validation,
    noise_identification,
    process_noise_adaptation,
    wear_filter,
)
from impactcell.tracking.wear_batch import noise_scale as noises
from impactcell.tracking.wear_batch import run_length_bank as banks
from impactcell.tracking.wear_batch.settings import BatchKnowledge, TrackerSettings
from impactcell.tracking.wear_batch.state import (
    ChangePoint,
    FrictionObservation,
    TrackerState,
    TrackingResult,
)
from impactcell.tracking.wear_batch.state_reports import empty_result, tracking_result

EARLIEST_CHANGE = 3  # no unannounced batch change is believed to be before
SHORTEST_BATCH = 4.0  # a batch id that lasts fewer cycles than this on average says nothing about batches


def update(settings: TrackerSettings, state: TrackerState, reading: FrictionObservation) -> TrackingResult:
    """Take one cycle into the state.

    A reading that cannot be used leaves wear and batch as they were, says why, and the next good one
    is used. Cycle numbers may be missing, late, repeated or restart; the clock may go back.
    """
    clock, where = input_validation.update_clock(
        state.clock, reading.cycle, reading.time_ns, settings.reorder_limit
    )
    problem, unusable = input_validation.validate_estimate(reading.mu_s, reading.mu_s_std)
    notes = [note for note in (where.note, problem) if note]
    noise = state.noise
    if not (unusable or where.repeated):
        identical = noises.identical_run(noise, reading.mu_s)
        if identical >= settings.identical_limit:
            notes.append(f"mu_s has been the same {identical} times in a row, not used")
            noise, unusable = replace(noise, identical=identical), True
    if unusable or where.repeated:
        # the clock must not pass a cycle that was not taken in: its time passes with the next one
        clock = replace(clock, last=state.clock.last) if state.clock.seen else state.clock
        kept = replace(state, clock=clock, noise=noise)
        if len(state.bank) == 0:
            return empty_result(settings, kept, reading, notes)
        return tracking_result(settings, kept, reading, notes, used=False)
    noise, std = noises.update(
        noise, reading.mu_s, input_validation.valid_std(reading.mu_s_std), late=where.lag > 0
    )
    variance = noises.variance(noise, std)
    if len(state.bank) == 0:
        fresh = replace(state, clock=clock, noise=noise)
        fresh = _first_cycle(settings, fresh, reading, variance, std, where.index)
        return tracking_result(settings, fresh, reading, notes, used=True)
    before, announced = _follow_batch_id(settings, state, reading, where)
    if before.batch_count > 10 and where.index - before.first < SHORTEST_BATCH * before.batch_count:
        notes.append("the batch id changes too often to say anything of batches")
    bank, outliers, statistic = batches.update_bank(settings, before, reading, variance, where, announced)
    fresh, shift = batches.detect_change(settings, before, reading, noise, bank, statistic, where, announced)
    fresh, known, shift, innovation = _update_filter(
        settings, fresh, reading, noise, bank, variance, where, shift
    )
    monitor, factor = fresh.monitor, 1.0
    if where.lag == 0:
        monitor, factor = process_noise_adaptation.update(monitor, innovation)
    fresh = replace(
        fresh, clock=clock, noise=noise, bank=bank, outliers=outliers, filter=known, monitor=monitor
    )
    if where.lag == 0:
        fresh, added = _update_process_noise(settings, fresh, reading, std, where.index, announced, factor)
        notes.extend(added)
    expected = announced > 0.0 and reading.expected_change
    return tracking_result(
        settings, fresh, reading, notes, used=True, shift=shift, innovation=innovation, expected=expected
    )


def _first_cycle(
    settings: TrackerSettings,
    state: TrackerState,
    reading: FrictionObservation,
    variance: float,
    std: float,
    index: int,
) -> TrackerState:
    slope_std = settings.slope_std * math.sqrt(variance)
    first = reading.batch_id if settings.batch is BatchKnowledge.KNOWN else None
    history = noise_identification.append_cycle(
        noise_identification.CommissioningRecord(), index, reading.mu_s, std, -1.0, first
    )
    return replace(
        state,
        bank=banks.initial_bank(reading.mu_s, variance, slope_std, index, settings.outlier_probability),
        filter=None if first is None else wear_filter.initial_state(reading.mu_s, variance, slope_std, first),
        accepted=index,
        accepted_before=index,
        first=index,
        replayed=state.noise,
        level_variance=settings.level_noise**2 * variance,
        slope_variance=settings.slope_noise**2 * variance,
        batch_id=reading.batch_id,
        batch_start=index,
        batch_count=1,
        history=history,
    )


def _follow_batch_id(
    settings: TrackerSettings,
    state: TrackerState,
    reading: FrictionObservation,
    where: input_validation.CycleTiming,
) -> tuple[TrackerState, float]:
    """Follow the PLC's batch id; 1: the batch changes with this cycle, -1: surely not, 0: nobody says."""
    said = reading.batch_id
    believed = settings.batch is BatchKnowledge.KNOWN and said is not None
    if where.lag > 0:
        return state, 0.0
    if said is None or said == state.batch_id:
        # an odd first value must not pass for a batch of one cycle
        sure = where.index < state.first + EARLIEST_CHANGE
        return state, 1.0 if reading.expected_change else -1.0 if sure else 0.0
    fresh = replace(
        state,
        batch_id=said,
        previous_batch=state.batch_id,
        batch_start=where.index,
        batch_count=state.batch_count + 1,
        tested=reading.expected_change,
    )
    return fresh, 1.0 if believed or reading.expected_change else 0.0


def _update_filter(
    settings: TrackerSettings,
    state: TrackerState,
    reading: FrictionObservation,
    noise: noises.NoiseScale,
    bank: Samples,
    variance: float,
    where: input_validation.CycleTiming,
    shift: ChangePoint | None,
) -> tuple[TrackerState, wear_filter.WearFilter | None, ChangePoint | None, float]:
    """Take the reading, in `bank` by now, into the filter where the batch is known; its innovation."""
    said, current = reading.batch_id, state.filter
    known = settings.batch is BatchKnowledge.KNOWN
    forgotten = where.lag > 0 and current is not None and said not in current.batches
    if known and said is not None and current is not None and shift is None and not forgotten:
        return _update_known_batch(settings, state, reading, noise, said, current, variance, where)
    innovation = batches.innovation(state, reading, variance, where)
    if known and said is None:
        if current is not None and where.lag == 0:
            # nobody says of which batch the cycle was: its time passes; after a change the bank knows better
            passed = wear_filter.predict(current, where.passed, state.level_variance, state.slope_variance)
            current = passed if shift is None else None
    elif known and said is not None and current is None:
        current = wear_filter.from_bank(*banks.moments(bank), said)
    elif known and current is not None and shift is not None:
        current = wear_filter.restart_after_change(current, *banks.moments(bank))
        # what was learned of the noise from here on would be learned from a mix of two materials
        state = replace(state, tested=True, history=None)
    # else a late cycle of a batch that the filter has forgotten is in the bank only
    return state, current, shift, innovation


def _update_known_batch(
    settings: TrackerSettings,
    state: TrackerState,
    reading: FrictionObservation,
    noise: noises.NoiseScale,
    said: str,
    current: wear_filter.WearFilter,
    variance: float,
    where: input_validation.CycleTiming,
) -> tuple[TrackerState, wear_filter.WearFilter, ChangePoint | None, float]:
    """Take a reading of a known batch into the filter, and test the batch against the one before."""
    if where.lag == 0:
        current = wear_filter.predict(current, where.passed, state.level_variance, state.slope_variance)
        if said != current.current:
            current = wear_filter.switch_batch(current, said, settings.step_std**2 * variance)
    current, error = wear_filter.update(
        current, reading.mu_s, variance, settings.outlier_threshold, where.lag, said
    )
    state, shift = batches.compare_with_previous_batch(settings, state, current, noise, variance, where.index)
    return state, current, shift, error.value / error.std


def _update_process_noise(
    settings: TrackerSettings,
    state: TrackerState,
    reading: FrictionObservation,
    std: float,
    index: int,
    announced: float,
    factor: float,
) -> tuple[TrackerState, list[str]]:
    """Commission the process noise from the first cycles, later keep it honest by `factor`."""
    notes: list[str] = []
    unit = state.noise.factor * state.noise.usual_std**2
    if factor != 1.0:
        level = process_noise_adaptation.adapt_process_noise(state.level_variance, factor, unit)
        if level != state.level_variance:
            notes.append(
                f"innovations are correlated: process noise {'raised' if factor > 1.0 else 'lowered'}"
            )
        state = replace(state, level_variance=level)
    if state.history is None:
        return state, notes
    history = noise_identification.append_cycle(
        state.history, index, reading.mu_s, std, announced, reading.batch_id
    )
    n = len(history.rows)
    ended = n >= settings.commissioning_cycles
    looked = ended or n in noise_identification.SCHEDULE
    state = replace(state, history=None if ended else history)
    if not (looked or n in noise_identification.EARLY):
        return state, notes
    values, stds = history.rows[:, noise_identification.VALUE], history.rows[:, noise_identification.STD]
    if n in noise_identification.EARLY:
        state = replace(state, noise=noises.refit(state.noise, values, stds))
        unit = state.noise.factor * state.noise.usual_std**2
    together, apart = noises.scale_change(state.noise, state.replayed, stds)
    rescaled = together > noise_identification.RESCALED or apart > noise_identification.RESHAPED
    if not (looked or rescaled):
        return state, notes
    level_walk, slope_walk = settings.level_noise, settings.slope_noise
    if looked:
        level_walk, slope_walk = noise_identification.identify_random_walks(settings, history, state.noise)
    level, slope = level_walk**2 * unit, slope_walk**2 * unit
    unchanged = level == state.level_variance and slope == state.slope_variance
    if unchanged and not rescaled:
        return state, notes
    again = noise_identification.replay_bank(settings, history, state.noise, level_walk, slope_walk)
    filtered = state.filter and noise_identification.replay_filter(
        settings, history, state.noise, level_walk, slope_walk
    )
    fresh = replace(state, bank=again.bank, outliers=again.outliers, filter=filtered)
    fresh = replace(fresh, level_variance=level, slope_variance=slope)
    return replace(fresh, replayed=state.noise), notes
