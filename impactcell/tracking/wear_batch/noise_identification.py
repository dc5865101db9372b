"""Process noise learned from a cell's first cycles: the random walks under which they are most likely.

The likelihood is the bank's own, with batch changes and outliers already averaged over, so that neither
passes for a random walk. A random walk is adopted only where it is clearly more likely than none: one
adopted by mistake costs a wear rate most of its precision.
"""

import math
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from impactcell.records import Samples
from impactcell.tracking.wear_batch import noise_scale as noises
from impactcell.tracking.wear_batch import run_length_bank as banks
from impactcell.tracking.wear_batch import wear_filter
from impactcell.tracking.wear_batch.noise_scale import NoiseScale
from impactcell.tracking.wear_batch.settings import TrackerSettings

SCHEDULE = (50, 100, 200)  # cycles after which there is a first look, before the end of commissioning
EARLY = (
    4,
    8,
    12,
    *range(16, 200, 4),
    250,
    300,
    400,
)  # cycles after which a wrong scale of the noise is corrected
RESCALED = 1.07  # factor by which it must have moved
RESHAPED = 1.5  # the same for variances that move apart: how far declared ones are believed
LEVEL_WALKS = (0.0, 0.01, 0.03, 0.1, 0.3)  # standard deviations a cycle, of one estimate's
SLOPE_WALKS = (0.0, 1e-5, 1e-4, 1e-3)
CLEARLY = 5.0  # nats by which a random walk must be more likely than none

INDEX, VALUE, STD, ANNOUNCED, BATCH = range(5)


@dataclass(frozen=True, slots=True, eq=False)
class CommissioningRecord:
    """The first cycles, as they were taken in.

    Attributes
    ----------
    rows : ndarray, shape (n, 5)
        Index, value, declared standard deviation, what the bank was told of a batch change (1: one came,
        -1: surely none, 0: nothing), place of the batch in `batches` (-1 without one).
    batches : tuple of str
    """

    rows: Samples = field(default_factory=lambda: np.zeros((0, 5)))
    batches: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class ReplayResult:
    """The bank after the history, outliers among how many readings, and the history's log likelihood."""

    bank: Samples
    outliers: tuple[float, float]
    likelihood: float


def append_cycle(
    history: CommissioningRecord, index: int, value: float, std: float, announced: float, batch: str | None
) -> CommissioningRecord:
    """Add one cycle."""
    batches = history.batches
    if batch is not None and batch not in batches:
        batches = (*batches, batch)
    place = -1.0 if batch is None else float(batches.index(batch))
    rows = np.vstack([history.rows, [index, value, std, announced, place]])
    return replace(history, rows=rows, batches=batches)


def replay_bank(
    settings: TrackerSettings,
    history: CommissioningRecord,
    noise: NoiseScale,
    level_walk: float,
    slope_walk: float,
) -> ReplayResult:
    """Run the bank over the history.

    Parameters
    ----------
    noise : Noise
        What is known of it by now.
    level_walk, slope_walk : float
        Standard deviations a cycle, in standard deviations of one estimate.
    """
    rows = history.rows
    variance = noises.variances(noise, rows[:, STD])
    unit = float(np.median(variance))
    readings = np.zeros((len(rows), 6))
    readings[:, 0], readings[:, 1], readings[:, 4] = rows[:, VALUE], variance, rows[:, INDEX]
    readings[1:, 2] = np.diff(rows[:, INDEX])
    readings[:, 5] = rows[:, ANNOUNCED]
    table = np.zeros((banks.ROWS, banks.WIDTH))
    slope_std = settings.slope_std * float(np.sqrt(variance[0]))
    first = banks.initial_bank(
        rows[0, VALUE], variance[0], slope_std, int(rows[0, INDEX]), settings.outlier_probability
    )
    table[: len(first)] = first
    design = banks.design(
        settings.hazard,
        settings.step_std**2 * unit,
        level_walk**2 * unit,
        slope_walk**2 * unit,
        settings.outlier_probability,
        slope_std**2,
    )
    outliers = np.zeros(2)
    count, likelihood = banks.update_series(table, len(first), design, readings, outliers, rows[0, INDEX])
    return ReplayResult(table[:count].copy(), (float(outliers[0]), float(outliers[1])), likelihood)


def identify_random_walks(
    settings: TrackerSettings, history: CommissioningRecord, noise: NoiseScale
) -> tuple[float, float]:
    """Find the random walks of level and slope, in standard deviations of one estimate a cycle."""
    start = (settings.level_noise, settings.slope_noise)

    @cache
    def likelihood(level: float, slope: float) -> float:
        return replay_bank(settings, history, noise, level, slope).likelihood

    none = likelihood(*start)
    level, best = start[0], none
    for walk in LEVEL_WALKS:
        found = likelihood(walk, start[1])
        if found > max(best, none + CLEARLY):
            level, best = walk, found
    slope, base = start[1], best
    for walk in SLOPE_WALKS:
        found = likelihood(level, walk)
        if found > max(best, base + CLEARLY):
            slope, best = walk, found
    return level, slope


def replay_filter(
    settings: TrackerSettings,
    history: CommissioningRecord,
    noise: NoiseScale,
    level_walk: float,
    slope_walk: float,
) -> wear_filter.WearFilter:
    """Run the filter of known batches over the history."""
    rows = history.rows[history.rows[:, BATCH] >= 0.0]
    variance = noises.variances(noise, rows[:, STD])
    unit = float(np.median(variance))
    names = [history.batches[int(place)] for place in rows[:, BATCH]]
    state = wear_filter.initial_state(
        rows[0, VALUE], variance[0], settings.slope_std * math.sqrt(variance[0]), names[0]
    )
    for before, row, own, name in zip(rows[:-1], rows[1:], variance[1:], names[1:], strict=True):
        passed = int(row[INDEX] - before[INDEX])
        state = wear_filter.predict(state, passed, level_walk**2 * unit, slope_walk**2 * unit)
        if name != state.current:
            state = wear_filter.switch_batch(state, name, settings.step_std**2 * own)
        state, _ = wear_filter.update(state, row[VALUE], own, settings.outlier_threshold)
    return state
