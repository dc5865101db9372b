"""A cycle taken into the bank of run lengths, and into the blocks of wear where the batch is unknown."""

import math
from dataclasses import dataclass

import numpy as np

from impactcell.records import Samples
from impactcell.tracking.wear_batch import noise_scale, rate_changes, run_length_bank, wear_blocks
from impactcell.tracking.wear_batch.block_filter import BlockModel
from impactcell.tracking.wear_batch.run_length_model import (
    OFFSET,
    SLOPE,
    TOTAL,
    BankModel,
    Measurement,
)
from impactcell.tracking.wear_batch.settings import BatchKnowledge, TrackerSettings
from impactcell.tracking.wear_batch.state import TrackerState, UsableCycle

SMALLEST_WEIGHT = 1e-6
"""Share of its weight that an outlier keeps in its block: however far off, it moves nothing."""
WEAR_OF_BANK = np.zeros((3, 4))
"""Slope, level and total from the bank's mean: the level is the total less the offset."""
WEAR_OF_BANK[0, SLOPE] = WEAR_OF_BANK[1, TOTAL] = WEAR_OF_BANK[2, TOTAL] = 1.0
"""Each is what the bank has under that name [1]."""
WEAR_OF_BANK[1, OFFSET] = -1.0
"""Offsets are no wear [1]."""


@dataclass(frozen=True, slots=True, eq=False)
class BankUpdate:
    """The bank after a cycle.

    Attributes
    ----------
    bank : ndarray, shape (k, 22)
    outliers : tuple of float
        See `TrackerState`.
    rates : ndarray, shape (m, 22)
        See `TrackerState`.
    statistic, rate_statistic : float
        Of another batch, and of another rate, since the last change that was reported.
    batch_over_rate : float
        Of another batch against another rate alone.
    outlier_share : float
        Probability that the cycle's estimate is an outlier.
    """

    bank: Samples
    outliers: tuple[float, float]
    rates: Samples
    statistic: float
    rate_statistic: float
    batch_over_rate: float
    outlier_share: float


def bank_model(settings: TrackerSettings, state: TrackerState, cycle: UsableCycle) -> BankModel:
    """Give what the bank assumes at a cycle."""
    return BankModel(
        hazard=settings.hazard,
        step_variance=settings.step_std**2 * cycle.variance,
        level_variance=state.level_variance,
        slope_variance=state.slope_variance,
        outlier_probability=settings.outlier_probability,
        slope_prior=settings.slope_std**2 * cycle.variance,
    )


def bank_measurement(cycle: UsableCycle) -> Measurement:
    """Give what a cycle brings to the bank."""
    timing = cycle.timing
    return Measurement(
        value=cycle.observation.mu_s,
        variance=cycle.variance,
        cycles=float(timing.passed),
        lag=float(timing.lag),
        cycle=float(timing.index),
        announced=cycle.announced,
    )


def update_bank(settings: TrackerSettings, state: TrackerState, cycle: UsableCycle) -> BankUpdate:
    """Take a cycle into the bank."""
    bank = run_length_bank.workspace(state.bank)
    model, measurement = bank_model(settings, state, cycle), bank_measurement(cycle)
    outliers, accepted = np.array(state.outliers), float(state.accepted)
    probability = run_length_bank.outlier_probability(model.outlier_probability, *state.outliers)
    count, log_density, outlier_share = run_length_bank.take(
        bank, len(state.bank), model, measurement, outliers, accepted
    )
    since = run_length_bank.settled_until(measurement, accepted)
    begun = float(state.first_index if state.rate_change is None else state.rate_change.detected_at)
    in_bank = rate_changes.BankOutcome(probability, log_density, since, begun)
    rates, before = (
        run_length_bank.workspace(state.rates, rate_changes.ROWS),
        run_length_bank.records(state.bank),
    )
    found = rate_changes.take(rates, len(state.rates), before, model, measurement, in_bank)
    weighed = rate_changes.statistics(bank[:count], rates[:found], model, measurement, accepted)
    return BankUpdate(
        run_length_bank.stored(bank, count),
        (float(outliers[0]), float(outliers[1])),
        run_length_bank.stored(rates, found),
        *weighed,
        outlier_share,
    )


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


def innovation(state: TrackerState, cycle: UsableCycle) -> float:
    """Give the estimate minus what the bank predicts before it is taken in, in standard deviations."""
    bank = run_length_bank.wear_moments(state.bank)
    ahead = cycle.timing.passed - cycle.timing.lag
    predicted = bank.total + ahead * bank.slope
    variance = bank.total_variance + 2.0 * ahead * bank.total_slope
    variance = variance + ahead**2 * bank.slope_variance + cycle.variance
    return (cycle.observation.mu_s - predicted) / math.sqrt(variance)
