"""The tracker's process noise: commissioned from the first cycles, later the walk that explains them best."""

import math
from dataclasses import replace

import numpy as np

from impactcell.tracking.wear_batch import (
    batch_change_detection,
    batch_filter,
    noise_identification,
    noise_scale,
    run_length_bank,
    walk_models,
)
from impactcell.tracking.wear_batch.batch_filter import BankUpdate
from impactcell.tracking.wear_batch.noise_identification import CommissioningRecord
from impactcell.tracking.wear_batch.settings import BatchKnowledge, TrackerSettings
from impactcell.tracking.wear_batch.state import TrackerState, UsableCycle


def commission(
    settings: TrackerSettings,
    state: TrackerState,
    cycle: UsableCycle,
    commissioning: CommissioningRecord,
) -> TrackerState:
    """Commission the process noise from the first cycles."""
    batch = cycle.observation.batch_id if settings.batch is BatchKnowledge.KNOWN else None
    record = noise_identification.append_cycle(commissioning, cycle, batch)
    cycles = len(record.rows)
    due = cycles - settings.commissioning_delay
    is_ended = due >= settings.commissioning_cycles
    identifies = is_ended or due in noise_identification.IDENTIFIED_AT
    state = replace(state, commissioning=None if is_ended else record)
    if cycles in noise_identification.REFITTED_AT or noise_scale.is_rough(state.noise):
        values, stds = record.rows[:, noise_identification.VALUE], record.rows[:, noise_identification.STD]
        state = replace(state, noise=noise_scale.refit(state.noise, values, stds))
    elif not identifies:
        return state
    return _replayed(settings, state, record, identifies=identifies)


def compare_models(
    settings: TrackerSettings, state: TrackerState, cycle: UsableCycle, updated: BankUpdate
) -> tuple[TrackerState, UsableCycle, BankUpdate, list[str]]:
    """Take a cycle, in the tracker's bank by now, into those of other models; believe one that is likelier.

    Where a change is at hand they weigh it too. Gives back what is believed from this cycle on.
    """
    if state.walk_models is None:
        believed = state.level_variance, state.slope_variance
        unit = noise_scale.usual_variance(state.noise)
        begun = walk_models.begin(updated.bank, updated.outliers, believed, unit)
        return replace(state, walk_models=begun), cycle, updated, []
    models = walk_models.append(state.walk_models, batch_filter.bank_measurement(cycle))
    is_at_hand = updated.statistic > run_length_bank.threshold(settings.false_alarm_cycles)
    if len(models.cycles) < walk_models.TOGETHER and not is_at_hand:
        return replace(state, walk_models=models), cycle, updated, []
    log_odds = noise_scale.log_odds_of_growth(cycle.noise)
    model = batch_filter.bank_model(settings, state, cycle)
    taken, statistic = walk_models.take_in(models, model, state.accepted, log_odds)
    models = walk_models.believing(taken, log_odds, cycle.noise.variogram.correlation)
    updated = replace(updated, statistic=-float(np.logaddexp(-statistic, -updated.batch_over_rate)))
    place = models.believed
    if place == taken.believed:
        return replace(state, walk_models=models), cycle, updated, []
    seen, cycles = models.outliers[place].tolist()
    # what was weighed by what is no longer believed is weighed anew with the next cycle
    updated = replace(
        updated,
        bank=models.banks[place],
        rates=run_length_bank.EMPTY,
        outliers=(seen, cycles),
        statistic=-math.inf,
        rate_statistic=-math.inf,
    )
    level, slope, scatter = models.variances[place].tolist()
    if scatter > 1.0:
        noise = noise_scale.rescaled(cycle.noise, scatter)
        cycle = replace(cycle, noise=noise, variance=noise_scale.variance(noise, cycle.std))
        return replace(state, walk_models=None), cycle, updated, []
    how = "steadily" if level == slope == 0.0 else "unsteadily"
    note = f"friction is found to go {how} from cycle to cycle, the past is seen so from here on"
    state = replace(state, walk_models=models, level_variance=level, slope_variance=slope)
    return state, cycle, updated, [note]


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
    again = noise_identification.replay_bank(settings, record, state.noise, walks, state.accepted)
    known = state.filter
    if known is not None:
        known = noise_identification.replay_filter(settings, record, state.noise, walks, known)
    return replace(
        state,
        bank=again.bank,
        rates=again.rates,
        change_point=batch_change_detection.refined_change_point(state, again.bank),
        outliers=again.outliers,
        filter=known,
        level_variance=level,
        slope_variance=slope,
        replayed_noise=state.noise,
    )
