"""When a change of batch is certain enough to be reported.

Where the PLC says nothing of batches the bank of run lengths decides; where it gives each batch a name, the
present one is tested against the one before.
"""

import math
from dataclasses import replace

import numpy as np

from impactcell.records import Samples
from impactcell.tracking.wear_batch import run_length_bank, wear_filter
from impactcell.tracking.wear_batch.batch_filter import BankUpdate
from impactcell.tracking.wear_batch.noise_scale import DEGREES_PER_DIFFERENCE, NoiseScale, scale_change
from impactcell.tracking.wear_batch.settings import BatchKnowledge, TrackerSettings
from impactcell.tracking.wear_batch.state import ChangePoint, TrackerState, UsableCycle

FEWEST_DIFFERENCES = 18.0
"""Differences that the scale of the noise must rest on before a change is believed."""
LEARNING_DIFFERENCES = 100.0
"""Differences before which a scale that still moves is waited for."""
SETTLED = 1.15
"""Factor by which the scale may have moved since the first cycles were gone over with it."""
WAYS_KNOWN = 2.0
"""Ways to a false alarm where batches are known, within one and between two; they share the rate."""
SMALLEST_ODDS = 20.0
"""Bayes factor below which no two batches are said to differ, however long they are (Kass & Raftery 1995:
strong evidence)."""


def detect_change(
    settings: TrackerSettings, state: TrackerState, cycle: UsableCycle, updated: BankUpdate
) -> tuple[TrackerState, ChangePoint | None]:
    """Report the change that a cycle, in the bank by now, makes certain enough."""
    index = cycle.timing.index
    if cycle.announced > 0.0:
        # an announced change is no detection, and what came before it has been settled by it
        return replace(state, accepted_before=index - 1, accepted=index), None
    is_known = settings.batch is BatchKnowledge.KNOWN and cycle.observation.batch_id is not None
    ways = WAYS_KNOWN if is_known else 1.0
    threshold = run_length_bank.threshold(ways * settings.false_alarm_cycles)
    is_quiet = cycle.announced < 0.0 or cycle.timing.lag > 0
    if is_quiet or not is_certain(state, cycle.noise, updated.statistic, threshold):
        return state, None
    statistic = _student_statistic(updated.statistic, cycle.noise)
    first, size, std = run_length_bank.locate_change_point(updated.bank, state.accepted, index)
    change = ChangePoint(first, size, std, index, statistic, threshold)
    return replace(state, accepted_before=state.accepted, accepted=index, change_point=change), change


def refined_change_point(state: TrackerState, bank: Samples) -> ChangePoint | None:
    """Let the cycles since say more of the bank's last change: when it was and how large.

    Where no hypothesis of it is left beside one of no change, that is its size: none. Where those of later
    changes alone are left they say nothing of it, and it stays as it was told.
    """
    change = state.change_point
    if change is None or change.detected_at != state.accepted:
        return change
    if state.rate_change is not None and state.rate_change.detected_at > change.detected_at:
        return change
    first, size, std = run_length_bank.locate_change_point(bank, state.accepted_before, state.accepted)
    if math.isnan(size):
        oldest = run_length_bank.records(bank)["change_cycle"][0]
        return replace(change, size=0.0) if oldest <= state.accepted_before else change
    return replace(change, cycle=first, size=size, size_std=std)


def compare_with_previous_batch(
    settings: TrackerSettings, state: TrackerState, current: wear_filter.WearFilter, cycle: UsableCycle
) -> tuple[TrackerState, ChangePoint | None]:
    """Test whether the PLC's present batch differs from the one before.

    The log Bayes factor of a shift against none, by the density ratio of Savage and Dickey; under no
    shift its exponential is a martingale, so that a batch is reported in error with probability at
    most 1 / threshold (Ville 1939). The threshold shares the false alarms out over the batches.
    """
    previous = state.previous_batch
    if previous is None or previous not in current.batches:
        return state, None
    size, std, statistic, threshold = _contrast_test(settings, state, current, cycle)
    change = ChangePoint(state.batch_start, size, std, cycle.timing.index, statistic, threshold)
    if state.tested:
        is_reported = state.change_point is not None and state.change_point.cycle == state.batch_start
        return (replace(state, change_point=change) if is_reported else state), None
    if statistic <= threshold or not _scale_is_known(state, cycle.noise):
        return state, None
    return replace(state, change_point=change, tested=True), change


def differed_before(
    settings: TrackerSettings, state: TrackerState, current: wear_filter.WearFilter, cycle: UsableCycle
) -> bool:
    """Whether a batch that has come back was certain to differ from the one before already when it went.

    Where two parts take turns, that they differ is told once. `current` has the batch as the present one, and
    nothing of it since it came back.
    """
    if state.previous_batch not in current.batches or not _scale_is_known(state, cycle.noise):
        return False
    *_, statistic, threshold = _contrast_test(settings, state, current, cycle)
    return statistic > threshold


def reason_not_ready(state: TrackerState) -> str:
    """Say why no change of batch would be reported yet; empty where one would be."""
    if _scale_is_known(state, state.noise):
        return ""
    return "no change of batch is reported yet: the scale of the noise is still being learned"


def is_certain(state: TrackerState, noise: NoiseScale, statistic: float, threshold: float) -> bool:
    """Whether a log statistic is beyond its threshold however well the scale of the noise is known."""
    return _student_statistic(statistic, noise) > threshold and _scale_is_known(state, noise)


def _contrast_test(
    settings: TrackerSettings, state: TrackerState, current: wear_filter.WearFilter, cycle: UsableCycle
) -> tuple[float, float, float, float]:
    """Give size and standard deviation of the shift between two batches, and its statistic and threshold."""
    size, std = wear_filter.contrast(current, current.current, state.previous_batch)
    prior = settings.step_std * math.sqrt(cycle.variance)
    statistic = 0.5 * (size / std) ** 2 + math.log(std / prior)
    length = max(1.0, (state.batch_start - state.first_index) / max(state.batch_count - 1, 1))
    threshold = math.log(max(WAYS_KNOWN * settings.false_alarm_cycles / length, SMALLEST_ODDS))
    return size, std, statistic, threshold


def _student_statistic(statistic: float, noise: NoiseScale) -> float:
    """Log statistic of a change where the variance of the noise is itself estimated, from few differences.

    For a known variance the log likelihood ratio of a shift by t standard deviations is t^2/2, for one with
    nu degrees of freedom (nu + 1)/2 log(1 + t^2/nu): what is certain by the first cycles' scale may not be.
    """
    if not 0.0 < statistic < math.inf:
        return statistic
    degrees = DEGREES_PER_DIFFERENCE * noise.weight
    return 0.5 * (degrees + 1.0) * math.log1p(2.0 * statistic / degrees)


def _scale_is_known(state: TrackerState, noise: NoiseScale) -> bool:
    """Whether the scale of the noise is known well enough to tell a change from noise."""
    if noise.weight < FEWEST_DIFFERENCES:
        return False
    if state.commissioning is None or noise.weight >= LEARNING_DIFFERENCES:
        return True
    return scale_change(noise, state.replayed_noise, np.array([noise.last_std]))[0] < SETTLED
