"""One cycle of tracking: screen the reading, follow wear and batch, say what is believed afterwards."""

import math
from dataclasses import replace

import numpy as np

from impactcell.records import BatchState, Evidence, Quality, WearState
from impactcell.tracking import bank as banks
from impactcell.tracking import belief, screening, wear
from impactcell.tracking import noise as noises
from impactcell.tracking.settings import BatchKnowledge, TrackerSettings
from impactcell.tracking.state import Reading, Shift, Tracked, TrackerState


def track(settings: TrackerSettings, state: TrackerState, reading: Reading) -> Tracked:
    """Take one cycle into the state.

    A reading that cannot be used leaves wear and batch as they were, says why, and the next good one
    is used. Cycle numbers may be missing, late, repeated or restart; the clock may go back.
    """
    clock, where = screening.place(state.clock, reading.cycle, reading.time_ns, settings.reorder_limit)
    notes = [where.note] if where.note else []
    problem, unusable = screening.fault(reading.mu_s, reading.mu_s_std)
    if problem:
        notes.append(problem)
    if unusable or where.repeated:
        # the clock must not move past a cycle that was not taken in: its time passes with the next one
        kept = replace(clock, last=state.clock.last) if state.clock.seen else state.clock
        return _outcome(settings, replace(state, clock=kept), reading, notes, used=False)
    counted = noises.count_identical(state.noise, reading.mu_s)
    if counted.identical >= settings.identical_limit:
        notes.append(f"mu_s has been the same {counted.identical} times in a row, not used")
        kept = replace(clock, last=state.clock.last)
        return _outcome(settings, replace(state, clock=kept, noise=counted), reading, notes, used=False)
    known, std = noises.declared_std(counted, reading.mu_s, screening.usable_std(reading.mu_s_std))
    if where.lag == 0:
        known = noises.learn(known, reading.mu_s, std)
    variance = known.factor * std**2
    fresh = replace(state, clock=clock, noise=known)
    if len(state.bank) == 0:
        started = _begin(settings, fresh, reading, variance, where.index)
        return _outcome(settings, started, reading, notes, used=True)
    fresh, changed = _announce(settings, fresh, reading, where)
    fresh, shift, innovation = _take(settings, fresh, reading, variance, where, changed=changed)
    return _outcome(
        settings, fresh, reading, notes, used=True, shift=shift, innovation=innovation, changed=changed
    )


def _begin(
    settings: TrackerSettings, state: TrackerState, reading: Reading, variance: float, index: int
) -> TrackerState:
    slope_std = settings.slope_std * math.sqrt(variance)
    bank = banks.seed(reading.mu_s, variance, slope_std, index, settings.outlier_probability)
    first = reading.batch_id
    return replace(
        state,
        bank=bank,
        filter=None if first is None else wear.start(reading.mu_s, variance, slope_std, first),
        accepted=index,
        accepted_before=index,
        first=index,
        level_variance=settings.level_noise**2 * variance,
        slope_variance=settings.slope_noise**2 * variance,
        batch_id=first,
        batch_start=index,
        batch_count=1,
    )


def _announce(
    settings: TrackerSettings, state: TrackerState, reading: Reading, where: screening.Place
) -> tuple[TrackerState, bool]:
    """Follow the PLC's batch id; tell whether the batch changes with this cycle."""
    said = reading.batch_id
    if said is None or where.lag > 0 or said == state.batch_id:
        return state, reading.expected_change and where.lag == 0
    return (
        replace(
            state,
            batch_id=said,
            previous_batch=state.batch_id,
            batch_start=where.index,
            batch_count=state.batch_count + 1,
            tested=reading.expected_change,
        ),
        settings.batch is BatchKnowledge.KNOWN or reading.expected_change,
    )


def _take(
    settings: TrackerSettings,
    state: TrackerState,
    reading: Reading,
    variance: float,
    where: screening.Place,
    *,
    changed: bool,
) -> tuple[TrackerState, Shift | None, float]:
    known = settings.batch is BatchKnowledge.KNOWN and reading.batch_id is not None
    state, found, innovation = _take_bank(
        settings, state, reading, variance, where, changed=changed, sure=known
    )
    if known:
        state, found, innovation = _take_filter(settings, state, reading, variance, where)
    return state, found, innovation


def _take_bank(
    settings: TrackerSettings,
    state: TrackerState,
    reading: Reading,
    variance: float,
    where: screening.Place,
    *,
    changed: bool,
    sure: bool,
) -> tuple[TrackerState, Shift | None, float]:
    table = np.zeros((banks.CAPACITY + 2, banks.WIDTH))
    count = len(state.bank)
    table[:count] = state.bank
    design = banks.design(
        settings.hazard,
        settings.step_std**2 * variance,
        state.level_variance,
        state.slope_variance,
        settings.outlier_probability,
    )
    announced = 1.0 if changed else -1.0 if sure else 0.0
    values = np.array([reading.mu_s, variance, where.passed, where.lag, where.index, announced])
    before, spread = banks.moments(state.bank)
    innovation = (reading.mu_s - before[0] - where.passed * before[1]) / math.sqrt(spread[0, 0] + variance)
    count, _, statistic = banks.run_cycle(table, count, design, values, float(state.accepted))
    fresh = replace(state, bank=table[:count].copy())
    threshold = banks.threshold(settings.false_alarm_cycles)
    if changed:
        return replace(fresh, accepted_before=where.index - 1, accepted=where.index), None, innovation
    if sure or statistic <= threshold or where.lag > 0:
        return fresh, None, innovation
    fresh = replace(fresh, accepted_before=state.accepted, accepted=where.index)
    cycle, size, std = banks.last_shift(fresh.bank, fresh.accepted_before, fresh.accepted)
    shift = Shift(cycle, size, std, where.index, statistic, threshold)
    return replace(fresh, shift=shift), shift, innovation


def _take_filter(
    settings: TrackerSettings, state: TrackerState, reading: Reading, variance: float, where: screening.Place
) -> tuple[TrackerState, Shift | None, float]:
    batch = reading.batch_id or ""
    step = settings.step_std**2 * variance
    current = state.filter
    if current is None:
        mean, spread = banks.moments(state.bank)
        current = wear.resume(mean, spread, batch)
    if where.lag == 0:
        current = wear.pass_cycles(current, where.passed, state.level_variance, state.slope_variance)
        if batch != current.current:
            current = wear.change_batch(current, batch, step)
    elif batch not in current.batches:
        return state, None, math.nan
    current, error = wear.measure(
        current, reading.mu_s, variance, settings.outlier_threshold, where.lag, batch
    )
    fresh = replace(state, filter=current)
    innovation = error.value / error.std
    previous = state.previous_batch
    if previous is None or previous not in current.batches:
        return fresh, None, innovation
    size, std = wear.contrast(current, current.current, previous)
    statistic = 0.5 * (size / std) ** 2 + math.log(std / math.sqrt(step))
    length = max(1.0, (state.batch_start - state.first) / max(state.batch_count - 1, 1))
    threshold = math.log(max(settings.false_alarm_cycles / length, 20.0))
    shift = Shift(state.batch_start, size, std, where.index, statistic, threshold, expected=state.tested)
    if state.tested or statistic <= threshold:
        reported = state.shift is not None and state.shift.cycle == state.batch_start
        return (replace(fresh, shift=shift) if reported else fresh), None, innovation
    return replace(fresh, shift=shift, tested=True), shift, innovation


def _outcome(
    settings: TrackerSettings,
    state: TrackerState,
    reading: Reading,
    notes: list[str],
    *,
    used: bool,
    shift: Shift | None = None,
    innovation: float = math.nan,
    changed: bool = False,
) -> Tracked:
    reason = "; ".join(notes)
    if len(state.bank) == 0:
        nan = math.nan
        none = WearState(nan, nan, nan, nan, settings.wear_limit, nan, nan, nan, nan, Quality.BAD, reason)
        batch = BatchState(reading.batch_id or "", nan, nan, nan, nan, 0, Quality.BAD, reason)
        return Tracked(state, none, batch, None, reading.expected_change, nan, used, tuple(notes))
    quality = Quality.GOOD if used and not notes else Quality.UNCERTAIN
    filtered = (
        state.filter if settings.batch is BatchKnowledge.KNOWN and reading.batch_id is not None else None
    )
    if filtered is not None:
        level, slope = float(filtered.mean[0]), float(filtered.mean[1])
        spread = (filtered.covariance[0, 0], filtered.covariance[0, 1], filtered.covariance[1, 1])
        offset, offset_std = wear.offset(filtered, filtered.current)
    else:
        mean, full = banks.moments(state.bank)
        level, slope, offset = float(mean[0] - mean[2]), float(mean[1]), float(mean[2])
        level_var = full[0, 0] - 2.0 * full[0, 2] + full[2, 2]
        spread = (level_var, full[0, 1] - full[2, 1], full[1, 1])
        offset_std = math.sqrt(max(float(full[2, 2]), 0.0))
        if state.shift is not None and state.shift.found_at == state.accepted:
            cycle, size, std = banks.last_shift(state.bank, state.accepted_before, state.accepted)
            state = replace(state, shift=replace(state.shift, cycle=cycle, size=size, size_std=std))
    covariance = (float(spread[0]), float(spread[1]), float(spread[2]))
    walks = (state.level_variance, state.slope_variance)
    published = belief.wear_state(level, slope, covariance, walks, settings.wear_limit, quality, reason)
    last = state.shift
    batch = BatchState(
        reading.batch_id or state.batch_id or "",
        offset,
        offset_std,
        last.size if last else math.nan,
        last.size_std if last else math.nan,
        state.clock.number(last.cycle) if last else 0,
        quality,
        reason,
    )
    evidence = None if shift is None else _evidence(settings, state, shift)
    return Tracked(
        state, published, batch, evidence, changed and reading.expected_change, innovation, used, tuple(notes)
    )


def _evidence(settings: TrackerSettings, state: TrackerState, shift: Shift) -> Evidence:
    days = settings.false_alarm_cycles * state.clock.period_s / 86_400.0
    return Evidence(
        shift.statistic,
        shift.threshold,
        state.clock.number(shift.cycle),
        shift.size,
        shift.size_std,
        settings.false_alarm_cycles,
        days,
    )
