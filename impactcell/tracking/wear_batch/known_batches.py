"""A cycle taken into the filter that believes the PLC's batch ids, which the bank begins, also anew."""

from dataclasses import replace

from impactcell.tracking.wear_batch import (
    batch_change_detection,
    batch_filter,
    noise_identification,
    run_length_bank,
    wear_filter,
)
from impactcell.tracking.wear_batch.batch_filter import BankUpdate
from impactcell.tracking.wear_batch.settings import BatchKnowledge, TrackerSettings
from impactcell.tracking.wear_batch.state import ChangePoint, TrackerState, UsableCycle
from impactcell.tracking.wear_batch.wear_filter import WearFilter


def update_filter(
    settings: TrackerSettings,
    state: TrackerState,
    cycle: UsableCycle,
    updated: BankUpdate,
    change: ChangePoint | None,
) -> tuple[TrackerState, WearFilter | None, ChangePoint | None, float]:
    """Take a cycle, in the bank by now, into the filter where the batch is known; also its innovation."""
    batch_id, current, timing = cycle.observation.batch_id, state.filter, cycle.timing
    is_in_bank_only = timing.lag > 0 and current is not None and batch_id not in current.batches
    is_known = settings.batch is BatchKnowledge.KNOWN and batch_id is not None
    if is_known and _is_announced_under_same_id(cycle, current):
        # what is measured has changed, as by another model: the bank was told, and has the offset right
        change, has_changed = None, True
    else:
        has_changed = change is not None
    is_bent = state.rate_change is not None and state.rate_change.detected_at == timing.index
    if is_known and current is not None and not (has_changed or is_bent or is_in_bank_only):
        if _is_one_of_first(state, cycle, current):
            first = wear_filter.from_bank(*run_length_bank.moments(updated.bank), current.current)
            return state, first, change, batch_filter.innovation(state, cycle)
        return _update_known_batch(settings, state, cycle, current)
    innovation = batch_filter.innovation(state, cycle)
    if settings.batch is BatchKnowledge.UNKNOWN:
        # cycles pass that it is not told of: the bank goes on, and begins it anew
        return state, None, change, innovation
    if batch_id is None:
        if current is not None and timing.lag == 0:
            # nobody says of which batch the cycle was: its time passes; after a change the bank knows better
            has_changed = is_bent or change is not None or cycle.announced > 0.0
            current = None if has_changed else _pass_time(state, current, cycle)
    elif current is None:
        if timing.lag == 0:
            state, current = _begun(state, cycle, updated, batch_id)
    elif has_changed:
        current = wear_filter.restart_after_change(current, *run_length_bank.moments(updated.bank))
        # what was learned of the noise from here on would be learned from a mix of two materials
        state = replace(state, tested=True, commissioning=None)
    elif is_bent:
        current = wear_filter.restart_at_rate(current, *run_length_bank.moments(updated.bank))
    return state, current, change, innovation


def _begun(
    state: TrackerState, cycle: UsableCycle, updated: BankUpdate, batch_id: str
) -> tuple[TrackerState, WearFilter]:
    """Begin the filter at a cycle that is named, after others that were not: wear goes on as in the bank.

    The bank's reference is the first batch. That is this one where no change is known and no other was named,
    and where too few cycles came before it to be one.
    """
    moments = run_length_bank.moments(updated.bank)
    if state.commissioning is not None and state.commissioning.batches:
        # begun before, and given up: what the record says of batches is not all that there was
        state = replace(state, commissioning=None)
    is_same = state.accepted == state.first_index and state.batch_count == 1
    if is_same or _is_young(state, cycle):
        return state, wear_filter.from_bank(*moments, batch_id)
    return state, wear_filter.beside_reference(*moments, batch_id)


def with_past_seen_anew(state: TrackerState, updated: BankUpdate) -> TrackerState:
    """Let the filter follow a bank that sees all cycles anew: a change that was found in them may be none.

    Only while one batch id has been seen: the bank knows nothing of how others compare.
    """
    if state.filter is None or not state.tested or state.batch_count > 1:
        return state
    again = wear_filter.restart_after_change(state.filter, *run_length_bank.moments(updated.bank))
    return replace(state, filter=again)


def _is_one_of_first(state: TrackerState, cycle: UsableCycle, current: WearFilter) -> bool:
    """Whether the filter is still what the bank says: all cycles yet are of one batch, and few."""
    return _is_young(state, cycle) and current.batches == (cycle.observation.batch_id,)


def _is_young(state: TrackerState, cycle: UsableCycle) -> bool:
    return cycle.timing.index < state.first_index + noise_identification.EARLIEST_CHANGE


def _is_announced_under_same_id(cycle: UsableCycle, current: WearFilter | None) -> bool:
    observation = cycle.observation
    is_same_id = current is not None and observation.batch_id == current.current
    return observation.expected_change and is_same_id and cycle.timing.lag == 0


def _update_known_batch(
    settings: TrackerSettings, state: TrackerState, cycle: UsableCycle, current: WearFilter
) -> tuple[TrackerState, WearFilter, ChangePoint | None, float]:
    """Take a cycle of a known batch into the filter, and test the batch against the one before."""
    lag, variance, batch_id = cycle.timing.lag, cycle.variance, cycle.observation.batch_id
    if lag == 0:
        current = _pass_time(state, current, cycle)
        if batch_id is not None and batch_id != current.current:
            has_been_seen = batch_id in current.batches
            step = noise_identification.step_variance(settings, variance, young=_is_young(state, cycle))
            current = wear_filter.switch_batch(current, batch_id, step)
            if has_been_seen and batch_change_detection.differed_before(settings, state, current, cycle):
                state = replace(state, tested=True)
    current, error = wear_filter.update(
        current, cycle.observation.mu_s, variance, settings.outlier_threshold, lag, batch_id
    )
    state, change = batch_change_detection.compare_with_previous_batch(settings, state, current, cycle)
    return state, current, change, error.value / error.std


def _pass_time(state: TrackerState, current: WearFilter, cycle: UsableCycle) -> WearFilter:
    return wear_filter.predict(current, cycle.timing.passed, state.level_variance, state.slope_variance)
