"""Friction over batches: changes found by the bank where the PLC says nothing, tested where it does."""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.records import Samples
from impactcell.tracking.wear_batch import noise_scale, run_length_bank, wear_blocks, wear_filter
from impactcell.tracking.wear_batch.block_filter import BlockModel
from impactcell.tracking.wear_batch.noise_scale import NoiseScale, scale_change
from impactcell.tracking.wear_batch.run_length_model import (
    OFFSET,
    SLOPE,
    TOTAL,
    BankModel,
    Measurement,
)
from impactcell.tracking.wear_batch.settings import BatchKnowledge, TrackerSettings
from impactcell.tracking.wear_batch.state import ChangePoint, TrackerState, UsableCycle

FEWEST_DIFFERENCES = 18.0
"""Differences that the scale of the noise must rest on before a change is believed."""
DEGREES_PER_DIFFERENCE = 2.0 / 3.0
"""Degrees of freedom of a variance from n successive differences, over n (von Neumann 1941, Ann. Math. Stat.
12:367): neighbours share an estimate."""
LEARNING_DIFFERENCES = 100.0
"""Differences before which a scale that still moves is waited for."""
SETTLED = 1.15
"""Factor by which the scale may have moved since the first cycles were gone over with it."""
WAYS_KNOWN = 2.0
"""Ways to a false alarm where batches are known, within one and between two; they share the rate."""
SMALLEST_ODDS = 20.0
"""Bayes factor below which no two batches are said to differ, however long they are (Kass & Raftery 1995:
strong evidence)."""


@dataclass(frozen=True, slots=True, eq=False)
class BankUpdate:
    """The bank after a cycle.

    Attributes
    ----------
    bank : ndarray, shape (k, 22)
    outliers : tuple of float
        See `TrackerState`.
    statistic : float
        Of a change since the last one that was reported.
    outlier_share : float
        Probability that the cycle's estimate is an outlier.
    """

    bank: Samples
    outliers: tuple[float, float]
    statistic: float
    outlier_share: float


def update_bank(settings: TrackerSettings, state: TrackerState, cycle: UsableCycle) -> BankUpdate:
    """Take a cycle into the bank."""
    bank = run_length_bank.workspace(state.bank)
    model = BankModel(
        hazard=settings.hazard,
        step_variance=settings.step_std**2 * cycle.variance,
        level_variance=state.level_variance,
        slope_variance=state.slope_variance,
        outlier_probability=settings.outlier_probability,
        slope_prior=settings.slope_std**2 * cycle.variance,
    )
    timing = cycle.timing
    measurement = Measurement(
        value=cycle.observation.mu_s,
        variance=cycle.variance,
        cycles=float(timing.passed),
        lag=float(timing.lag),
        cycle=float(timing.index),
        announced=cycle.announced,
    )
    outliers = np.array(state.outliers)
    result = run_length_bank.update(
        bank, len(state.bank), model, measurement, outliers, float(state.accepted)
    )
    counts = float(outliers[0]), float(outliers[1])
    stored = run_length_bank.stored(bank, result.hypotheses)
    return BankUpdate(stored, counts, result.statistic, result.outlier_share)


SMALLEST_WEIGHT = 1e-6
"""Share of its weight that an outlier keeps in its block: however far off, it moves nothing."""
WEAR_OF_BANK = np.zeros((3, 4))
"""Slope, level and total from the bank's mean: the level is the total less the offset."""
WEAR_OF_BANK[0, SLOPE] = WEAR_OF_BANK[1, TOTAL] = WEAR_OF_BANK[2, TOTAL] = 1.0
"""Each is what the bank has under that name [1]."""
WEAR_OF_BANK[1, OFFSET] = -1.0
"""Offsets are no wear [1]."""


def update_blocks(
    settings: TrackerSettings, state: TrackerState, cycle: UsableCycle, updated: BankUpdate
) -> wear_blocks.WearBlocks | None:
    """Take a cycle, in the bank by now, into the blocks; None where the filter of known batches has it.

    Blocks that begin in the middle, as after an earlier version or when ids stop coming, go on from the
    bank. Where the rate itself walks at random, old blocks say little of it, and the bank reports alone.
    """
    observation, timing = cycle.observation, cycle.timing
    is_known = settings.batch is BatchKnowledge.KNOWN and observation.batch_id is not None
    if is_known or state.slope_variance > 0.0:
        return None
    unit = noise_scale.usual_variance(cycle.noise)
    if state.wear_blocks is None:
        mean, covariance = run_length_bank.moments(updated.bank)
        wear = WEAR_OF_BANK @ mean, WEAR_OF_BANK @ covariance @ WEAR_OF_BANK.T
        return wear_blocks.continue_from(timing.index + timing.lag, *wear, unit)
    if timing.lag > 0:
        return state.wear_blocks
    weight = unit / cycle.variance * max(1.0 - updated.outlier_share, SMALLEST_WEIGHT)
    blocks = wear_blocks.append(state.wear_blocks, timing.index, observation.mu_s, weight, cycle.announced)
    model = BlockModel(unit, settings.step_std**2 * unit, state.level_variance)
    return wear_blocks.update(blocks, model)


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
    statistic = _student_statistic(updated.statistic, cycle.noise)
    is_quiet = cycle.announced < 0.0 or cycle.timing.lag > 0 or statistic <= threshold
    if is_quiet or not _scale_is_known(state, cycle.noise):
        return state, None
    first, size, std = run_length_bank.locate_change_point(updated.bank, state.accepted, index)
    change = ChangePoint(first, size, std, index, statistic, threshold)
    return replace(state, accepted_before=state.accepted, accepted=index, change_point=change), change


def refined_change_point(state: TrackerState, bank: Samples) -> ChangePoint | None:
    """Let the cycles since say more of the bank's last change: when it was and how large."""
    change = state.change_point
    if change is None or change.detected_at != state.accepted:
        return change
    located = run_length_bank.locate_change_point(bank, state.accepted_before, state.accepted)
    return ChangePoint(*located, change.detected_at, change.statistic, change.threshold)


def innovation(state: TrackerState, cycle: UsableCycle) -> float:
    """Give the estimate minus what the bank predicts before it is taken in, in standard deviations."""
    bank = run_length_bank.wear_moments(state.bank)
    ahead = cycle.timing.passed - cycle.timing.lag
    predicted = bank.total + ahead * bank.slope
    variance = bank.total_variance + 2.0 * ahead * bank.total_slope
    variance = variance + ahead**2 * bank.slope_variance + cycle.variance
    return (cycle.observation.mu_s - predicted) / math.sqrt(variance)


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
    size, std = wear_filter.contrast(current, current.current, previous)
    prior = settings.step_std * math.sqrt(cycle.variance)
    statistic = 0.5 * (size / std) ** 2 + math.log(std / prior)
    length = max(1.0, (state.batch_start - state.first_index) / max(state.batch_count - 1, 1))
    threshold = math.log(max(WAYS_KNOWN * settings.false_alarm_cycles / length, SMALLEST_ODDS))
    change = ChangePoint(state.batch_start, size, std, cycle.timing.index, statistic, threshold)
    if state.tested:
        is_reported = state.change_point is not None and state.change_point.cycle == state.batch_start
        return (replace(state, change_point=change) if is_reported else state), None
    if statistic <= threshold or not _scale_is_known(state, cycle.noise):
        return state, None
    return replace(state, change_point=change, tested=True), change


def reason_not_ready(state: TrackerState) -> str:
    """Say why no change of batch would be reported yet; empty where one would be."""
    if _scale_is_known(state, state.noise):
        return ""
    return "no change of batch is reported yet: the scale of the noise is still being learned"


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
