"""One cycle of tracking: validate the estimate, update wear and batch, report what is known afterwards."""

import math
from dataclasses import replace

from impactcell.tracking.wear_batch import (
    batch_change_detection,
    batch_filter,
    input_validation,
    known_batches,
    noise_identification,
    noise_scale,
    process_noise,
    rate_change_detection,
    run_length_bank,
    wear_blocks,
    wear_filter,
)
from impactcell.tracking.wear_batch.input_validation import CycleTiming
from impactcell.tracking.wear_batch.settings import BatchKnowledge, TrackerSettings
from impactcell.tracking.wear_batch.state import (
    ANNOUNCED,
    RULED_OUT,
    UNSAID,
    FrictionObservation,
    TrackerState,
    TrackingResult,
    UsableCycle,
)
from impactcell.tracking.wear_batch.state_reports import CycleOutcome, empty_result, tracking_result

SHORTEST_BATCH = 4.0
"""Mean cycles a batch id must last to say anything about batches."""
JUDGED_BATCHES = 10
"""Batch ids after which their mean length is judged."""
COMMON_CYCLES = 100.0
"""Cycles over which what estimates share is averaged: velocities alternate, and a cell may be set anew."""


def update(
    settings: TrackerSettings, state: TrackerState, observation: FrictionObservation
) -> TrackingResult:
    """Take one cycle into the state.

    An estimate that cannot be used leaves wear and batch as they were, says why, and the next good one
    is used. Cycle numbers may be missing, late, repeated, wrong or restart; the clock may go back. A change
    that somebody said comes with one that cannot be used, or late, is expected with the next that is in
    order.
    """
    if state.expects_change:
        observation = replace(observation, expected_change=True)
    clock, timing = input_validation.update_clock(
        state.clock,
        observation.cycle,
        observation.time_ns,
        settings.reorder_limit,
        observation.session,
        _farthest(settings, state, observation),
        restarted=observation.restarted,
    )
    fault, is_unusable = input_validation.validate_estimate(observation.mu_s, observation.mu_s_std)
    notes = [note for note in (timing.note, fault) if note]
    is_unusable, noise = is_unusable or timing.doubted, state.noise
    if not (is_unusable or timing.repeated):
        identical = noise_scale.identical_run(noise, observation.mu_s)
        if identical >= settings.identical_limit:
            notes.append(
                f"mu_s has been the same {identical} times in a row, not used: a sensor is stuck, or values "
                "are rounded coarser than they scatter and need more decimals"
            )
            noise, is_unusable = replace(noise, identical=identical), True
    bend = state.rate_change
    if timing.lag > 0 and bend is not None and timing.index < bend.cycle:
        notes.append("the cycle is from before wear changed its rate, not used")
        is_unusable = True
    if is_unusable or timing.repeated:
        # the clock must not pass a cycle that was not taken in: its time passes with the next one
        clock = replace(clock, last=state.clock.last) if state.clock.seen else state.clock
        state = replace(state, clock=clock, noise=noise, expects_change=observation.expected_change)
        return _report(settings, state, observation, CycleOutcome(notes, used=False))
    noise, std = noise_scale.update(
        noise,
        observation.mu_s,
        input_validation.valid_std(observation.mu_s_std),
        late=timing.lag > 0,
        other_batch=_is_other_batch(settings, state, observation),
    )
    variance = noise_scale.variance(noise, std)
    expects_change = observation.expected_change and timing.lag > 0
    if len(state.bank) == 0:
        cycle = UsableCycle(observation, timing, noise, std, variance, RULED_OUT)
        state = replace(state, clock=clock, noise=noise, expects_change=expects_change)
        first = _first_state(settings, state, cycle)
        return _report(settings, first, observation, CycleOutcome(notes, used=True))
    state, announced = _follow_batch_id(settings, state, observation, timing)
    if (
        state.batch_count > JUDGED_BATCHES
        and timing.index - state.first_index < SHORTEST_BATCH * state.batch_count
    ):
        notes.append("the batch id changes too often to say anything of batches")
    cycle = UsableCycle(observation, timing, noise, std, variance, announced)
    updated = batch_filter.update_bank(settings, state, cycle)
    if state.commissioning is None and timing.lag == 0:
        state, cycle, updated, raised = process_noise.compare_models(settings, state, cycle, updated)
        state = known_batches.with_past_seen_anew(state, updated) if raised else state
        notes.extend(raised)
    state, updated, raised = rate_change_detection.detect_rate_change(settings, state, cycle, updated, clock)
    notes.extend(raised)
    before, found = batch_change_detection.detect_change(settings, state, cycle, updated)
    state, known, change, innovation = known_batches.update_filter(settings, before, cycle, updated, found)
    state = replace(
        state,
        clock=clock,
        noise=cycle.noise,
        filter=known,
        bank=updated.bank,
        rates=updated.rates if found is None else run_length_bank.EMPTY,
        outliers=updated.outliers,
        change_point=batch_change_detection.refined_change_point(state, updated.bank),
        wear_blocks=batch_filter.update_blocks(settings, state, cycle, updated),
        expects_change=expects_change,
    )
    state = _follow_common_error(state, cycle)
    if state.commissioning is not None and timing.lag == 0:
        state = process_noise.commission(settings, state, cycle, state.commissioning)
    is_expected = announced > 0.0 and observation.expected_change
    outcome = CycleOutcome(notes, used=True, change=change, innovation=innovation, expected=is_expected)
    return _report(settings, state, observation, outcome)


def _report(
    settings: TrackerSettings, state: TrackerState, observation: FrictionObservation, outcome: CycleOutcome
) -> TrackingResult:
    if len(state.bank) == 0:
        return empty_result(settings, state, observation, outcome)
    return tracking_result(settings, state, observation, outcome)


def _first_state(settings: TrackerSettings, state: TrackerState, cycle: UsableCycle) -> TrackerState:
    """Begin with the first usable cycle: its batch is the reference.

    Random walks that were learned before wear was reset are not looked for again.
    """
    observation, index, variance = cycle.observation, cycle.timing.index, cycle.variance
    slope_std = settings.slope_std * math.sqrt(variance)
    batch = observation.batch_id if settings.batch is BatchKnowledge.KNOWN else None
    if state.level_variance == state.slope_variance == 0.0:
        record = noise_identification.append_cycle(noise_identification.CommissioningRecord(), cycle, batch)
        state = replace(
            state,
            level_variance=settings.level_noise**2 * variance,
            slope_variance=settings.slope_noise**2 * variance,
            commissioning=record,
        )
    return replace(
        state,
        bank=run_length_bank.initial_bank(
            observation.mu_s, variance, slope_std, index, settings.outlier_probability
        ),
        filter=None
        if batch is None
        else wear_filter.initial_state(observation.mu_s, variance, slope_std, batch),
        wear_blocks=wear_blocks.begin(index, observation.mu_s, settings.slope_std) if batch is None else None,
        accepted=index,
        accepted_before=index,
        first_index=index,
        replayed_noise=state.noise,
        batch_id=observation.batch_id,
        batch_start=index,
        batch_count=1,
        common_variance=observation.common_std**2,
        common_cycles=1.0,
    )


def _follow_common_error(state: TrackerState, cycle: UsableCycle) -> TrackerState:
    """Average what estimates share while they are of the reference batch: later ones tell of an offset."""
    variance = cycle.observation.common_std**2
    if math.isnan(variance) or state.accepted != state.first_index or cycle.timing.lag > 0:
        return state
    if math.isnan(state.common_variance):
        return replace(state, common_variance=variance, common_cycles=1.0)
    cycles = min(state.common_cycles + 1.0, COMMON_CYCLES)
    mean = state.common_variance + (variance - state.common_variance) / cycles
    return replace(state, common_variance=mean, common_cycles=cycles)


def _farthest(settings: TrackerSettings, state: TrackerState, observation: FrictionObservation) -> float:
    """Give the cycles ahead beyond which a number is in doubt: more than have been followed, and are late."""
    if observation.number_is_sure:
        return math.inf
    return float(max(settings.reorder_limit, state.clock.last - state.first_index))


def _is_other_batch(settings: TrackerSettings, state: TrackerState, observation: FrictionObservation) -> bool:
    """Whether the estimate is said, and believed, to be of another batch than the one before."""
    is_other_id = observation.batch_id is not None and observation.batch_id != state.batch_id
    return observation.expected_change or (is_other_id and settings.batch is BatchKnowledge.KNOWN)


def _follow_batch_id(
    settings: TrackerSettings, state: TrackerState, observation: FrictionObservation, timing: CycleTiming
) -> tuple[TrackerState, float]:
    """Follow the PLC's batch id; also say whether the batch changes with this cycle."""
    batch_id, index = observation.batch_id, timing.index
    if timing.lag > 0:
        return state, UNSAID
    is_expected = observation.expected_change
    if batch_id is None or batch_id == state.batch_id:
        otherwise = RULED_OUT if index < state.first_index + noise_identification.EARLIEST_CHANGE else UNSAID
        return state, ANNOUNCED if is_expected else otherwise
    state = replace(
        state,
        batch_id=batch_id,
        previous_batch=state.batch_id,
        batch_start=index,
        batch_count=state.batch_count + 1,
        tested=is_expected,
    )
    is_believed = settings.batch is BatchKnowledge.KNOWN or is_expected
    return state, ANNOUNCED if is_believed else UNSAID
