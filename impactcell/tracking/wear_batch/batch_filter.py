"""Friction over batches: shifts found by the bank where the PLC says nothing, tested where it does."""

import math
from dataclasses import replace

import numpy as np

from impactcell.records import Samples
from impactcell.tracking.wear_batch import run_length_bank as banks
from impactcell.tracking.wear_batch import wear_filter
from impactcell.tracking.wear_batch.input_validation import CycleTiming
from impactcell.tracking.wear_batch.noise_scale import NoiseScale, scale_change
from impactcell.tracking.wear_batch.settings import BatchKnowledge, TrackerSettings
from impactcell.tracking.wear_batch.state import ChangePoint, FrictionObservation, TrackerState

FEWEST_DIFFERENCES = 18.0  # the scale of the noise must rest on so many before a shift is believed
LEARNING_DIFFERENCES = 100.0  # before so many,
BOTH = 2.0  # ways to a false alarm where batches are known: within one, and between two
SETTLED = 1.15  # it must not have moved by such a factor since the first cycles were gone over with it


def update_bank(
    settings: TrackerSettings,
    state: TrackerState,
    reading: FrictionObservation,
    variance: float,
    where: CycleTiming,
    announced: float,
) -> tuple[Samples, tuple[float, float], float]:
    """Take a reading into the bank.

    Parameters
    ----------
    announced : float
        1: a batch change came with this cycle, -1: surely none, 0: nobody says.

    Returns
    -------
    bank : ndarray, shape (k, 22)
    outliers : tuple of float
    statistic : float
        Of a change since the last one that was reported.
    """
    table = np.empty((banks.ROWS, banks.WIDTH))
    table[: len(state.bank)] = state.bank
    design = banks.design(
        settings.hazard,
        settings.step_std**2 * variance,
        state.level_variance,
        state.slope_variance,
        settings.outlier_probability,
        settings.slope_std**2 * variance,
    )
    values = np.array([reading.mu_s, variance, where.passed, where.lag, where.index, announced])
    outliers = np.array(state.outliers)
    count, _, statistic = banks.update(
        table, len(state.bank), design, values, outliers, float(state.accepted)
    )
    return table[:count].copy(), (float(outliers[0]), float(outliers[1])), statistic


def detect_change(
    settings: TrackerSettings,
    state: TrackerState,
    reading: FrictionObservation,
    noise: NoiseScale,
    bank: Samples,
    statistic: float,
    where: CycleTiming,
    announced: float,
) -> tuple[TrackerState, ChangePoint | None]:
    """Report the shift that a reading, in `bank` by now, makes certain enough."""
    if announced > 0.0:
        # an announced change is no finding, and what came before it has been settled by it
        return replace(state, accepted_before=where.index - 1, accepted=where.index), None
    # with known batches, false alarms are shared out to changes within a batch and between batches
    known = settings.batch is BatchKnowledge.KNOWN and reading.batch_id is not None
    ways = BOTH if known else 1.0
    threshold = banks.threshold(ways * settings.false_alarm_cycles)
    if announced < 0.0 or where.lag > 0 or statistic <= threshold or not _scale_is_known(state, noise):
        return state, None
    cycle, size, std = banks.locate_change_point(bank, state.accepted, where.index)
    shift = ChangePoint(cycle, size, std, where.index, statistic, threshold)
    return replace(state, accepted_before=state.accepted, accepted=where.index, shift=shift), shift


def innovation(
    state: TrackerState, reading: FrictionObservation, variance: float, where: CycleTiming
) -> float:
    """Give the reading minus what the bank predicts before it is taken in, in standard deviations."""
    mean, spread = banks.moments(state.bank)
    ahead = where.passed - where.lag
    predicted = mean[0] + ahead * mean[1]
    width = spread[0, 0] + 2.0 * ahead * spread[0, 1] + ahead**2 * spread[1, 1] + variance
    return float((reading.mu_s - predicted) / math.sqrt(width))


def compare_with_previous_batch(
    settings: TrackerSettings,
    state: TrackerState,
    current: wear_filter.WearFilter,
    noise: NoiseScale,
    variance: float,
    index: int,
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
    prior = settings.step_std * math.sqrt(variance)
    statistic = 0.5 * (size / std) ** 2 + math.log(std / prior)
    length = max(1.0, (state.batch_start - state.first) / max(state.batch_count - 1, 1))
    threshold = math.log(max(BOTH * settings.false_alarm_cycles / length, 20.0))
    shift = ChangePoint(state.batch_start, size, std, index, statistic, threshold)
    if state.tested:
        reported = state.shift is not None and state.shift.cycle == state.batch_start
        return (replace(state, shift=shift) if reported else state), None
    if statistic <= threshold or not _scale_is_known(state, noise):
        return state, None
    return replace(state, shift=shift, tested=True), shift


def reason_not_ready(state: TrackerState) -> str:
    """Say why no change of batch would be reported yet; empty where one would be."""
    if _scale_is_known(state, state.noise):
        return ""
    return "no change of batch is reported yet: the scale of the noise is still being learned"


def _scale_is_known(state: TrackerState, noise: NoiseScale) -> bool:
    """Whether the scale of the noise is known well enough to tell a shift from noise."""
    if noise.weight < FEWEST_DIFFERENCES:
        return False
    if state.history is None or noise.weight >= LEARNING_DIFFERENCES:
        return True
    return scale_change(noise, state.replayed, np.array([noise.last_std]))[0] < SETTLED
