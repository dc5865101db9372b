"""The tracker's process noise: commissioned from the first cycles, later the walk that explains them best."""

from dataclasses import replace

from impactcell.tracking.wear_batch import (
    batch_change_detection,
    batch_filter,
    noise_identification,
    noise_scale,
    walk_models,
)
from impactcell.tracking.wear_batch.noise_identification import CommissioningRecord
from impactcell.tracking.wear_batch.settings import TrackerSettings
from impactcell.tracking.wear_batch.state import TrackerState, UsableCycle


def update_process_noise(
    settings: TrackerSettings, state: TrackerState, cycle: UsableCycle
) -> tuple[TrackerState, list[str]]:
    """Commission the process noise from the first cycles, then let it follow the data; say what changed."""
    if state.commissioning is None:
        return _following(settings, state, cycle)
    record = noise_identification.append_cycle(state.commissioning, cycle, cycle.observation.batch_id)
    cycles = len(record.rows)
    due = cycles - settings.commissioning_delay
    is_ended = due >= settings.commissioning_cycles
    identifies = is_ended or due in noise_identification.IDENTIFIED_AT
    state = replace(state, commissioning=None if is_ended else record)
    if cycles in noise_identification.REFITTED_AT:
        values, stds = record.rows[:, noise_identification.VALUE], record.rows[:, noise_identification.STD]
        state = replace(state, noise=noise_scale.refit(state.noise, values, stds))
    elif not identifies:
        return state, []
    return _replayed(settings, state, record, identifies=identifies), []


def _following(
    settings: TrackerSettings, state: TrackerState, cycle: UsableCycle
) -> tuple[TrackerState, list[str]]:
    """Take a cycle into the banks under other walks, and believe the one that has become clearly likelier."""
    if state.walk_models is None:
        believed = state.level_variance, state.slope_variance
        unit = noise_scale.usual_variance(state.noise)
        begun = walk_models.begin(state.bank, state.outliers, believed, unit)
        return replace(state, walk_models=begun), []
    model = batch_filter.bank_model(settings, state, cycle)
    before = state.walk_models.believed
    models = walk_models.update(
        state.walk_models, batch_filter.bank_measurement(cycle), model, state.accepted
    )
    state = replace(state, walk_models=models)
    if models.believed == before:
        return state, []
    bank, outliers = models.banks[models.believed], models.outliers[models.believed].tolist()
    level, slope = models.variances[models.believed].tolist()
    believing = replace(
        state,
        bank=bank,
        outliers=(outliers[0], outliers[1]),
        change_point=batch_change_detection.refined_change_point(state, bank),
        level_variance=level,
        slope_variance=slope,
    )
    how = "steadily" if level == slope == 0.0 else "unsteadily"
    return believing, [f"friction is found to go {how} from cycle to cycle, the past is seen so from here on"]


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
