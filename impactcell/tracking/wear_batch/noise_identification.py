"""Process noise learned from a cell's first cycles: the random walks under which they are most likely.

The likelihood is the bank's own, with batch changes and outliers already averaged over, so that neither
passes for a random walk. A random walk is adopted only where it is clearly more likely than none: one
adopted by mistake costs a wear rate most of its precision.
"""

from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from impactcell.numerics.scatter_correlation import variance_over_scatter
from impactcell.records import Samples
from impactcell.tracking.wear_batch import noise_scale, rate_changes, run_length_bank, wear_filter
from impactcell.tracking.wear_batch.noise_scale import NoiseScale
from impactcell.tracking.wear_batch.run_length_model import Bank, BankModel
from impactcell.tracking.wear_batch.settings import TrackerSettings

if TYPE_CHECKING:
    from impactcell.tracking.wear_batch.state import UsableCycle

IDENTIFIED_AT = (50, 100)
"""Cycles after which random walks are looked for, before the end of commissioning."""
REFITTED_AT = (4, 8, 12, *range(16, 200, 4))
"""Cycles after which a wrong scale of the noise is corrected."""
RESCALED = 1.07
"""Factor by which it must have moved for the cycles to be gone over again."""
RESHAPED = 1.5
"""The same for variances that move apart: how far declared ones are believed."""
LEVEL_WALKS = (0.0, 0.01, 0.03, 0.1, 0.3)
"""Random walks of the level that are tried: standard deviation a cycle, in those of one estimate."""
SLOPE_WALKS = (0.0, 1e-5, 1e-4, 1e-3)
"""Random walks of the slope that are tried, in the same unit."""
CLEARLY = 5.0
"""Nats by which a random walk must be more likely than none: a Bayes factor of 150 (Kass & Raftery 1995); of
correlated scatter so many for each of the cycles that count as one."""

EARLIEST_CHANGE = 3
"""Cycles before which no unannounced batch change is believed: an odd first value is no batch. So long the
filter of known batches is what the bank says, which knows that the first value may be an outlier."""

FIRST_STEP = 4.0
"""Standard deviation of the step to a batch that comes before that, in that of others: where a step is larger
than was thought, a level that rests on one or two values gives way instead of the offset."""

INDEX, VALUE, STD, BATCH_CHANGE, BATCH = range(5)
"""Columns of a `CommissioningRecord`."""


@dataclass(frozen=True, slots=True, eq=False)
class CommissioningRecord:
    """The first cycles, as they were taken in.

    Attributes
    ----------
    rows : ndarray, shape (n, 5)
        Index, value, declared standard deviation, what the bank was told of a batch change (see
        `UsableCycle.announced`), place of the batch in `batches` (-1 without one).
    batches : tuple of str
    """

    rows: Samples = field(default_factory=lambda: np.zeros((0, 5)))
    batches: tuple[str, ...] = ()


class RandomWalks(NamedTuple):
    """Standard deviations a cycle of the walks of level and slope, in standard deviations of one estimate."""

    level: float
    slope: float


@dataclass(frozen=True, slots=True, eq=False)
class BankReplay:
    """The bank after the record, other rates beside it, and outliers among how many estimates."""

    bank: Samples
    rates: Samples
    outliers: tuple[float, float]


def append_cycle(record: CommissioningRecord, cycle: "UsableCycle", batch: str | None) -> CommissioningRecord:
    """Add one cycle."""
    batches = record.batches
    if batch is not None and batch not in batches:
        batches = (*batches, batch)
    place = -1.0 if batch is None else float(batches.index(batch))
    row = [cycle.timing.index, cycle.observation.mu_s, cycle.std, cycle.announced, place]
    return replace(record, rows=np.vstack([record.rows, row]), batches=batches)


def replay_bank(
    settings: TrackerSettings,
    record: CommissioningRecord,
    noise: NoiseScale,
    walks: RandomWalks,
    accepted: int,
) -> BankReplay:
    """Run the bank over the record with what is known of the noise by now.

    `accepted` is the last cycle at which a change of batch was reported.
    """
    begun = _begin(settings, record, noise, walks)
    rates = run_length_bank.workspace(run_length_bank.EMPTY, rate_changes.ROWS)
    outliers = np.zeros(2)
    count, found = rate_changes.replay(
        begun.bank, begun.hypotheses, rates, begun.model, begun.series, outliers, float(accepted)
    )
    stored, counts = run_length_bank.stored, (float(outliers[0]), float(outliers[1]))
    return BankReplay(stored(begun.bank, count), stored(rates, found), counts)


def _log_likelihood(
    settings: TrackerSettings, record: CommissioningRecord, noise: NoiseScale, walks: RandomWalks
) -> float:
    """Log likelihood of the record under random walks."""
    begun = _begin(settings, record, noise, walks)
    accepted = float(record.rows[0, INDEX])
    _, likelihood = run_length_bank.update_series(
        begun.bank, begun.hypotheses, begun.model, begun.series, np.zeros(2), accepted
    )
    return likelihood


class _Begun(NamedTuple):
    """A bank at the first cycle of a record, and all of them, columns as the fields of `Measurement`."""

    bank: Bank
    hypotheses: int
    model: BankModel
    series: Samples


def _begin(
    settings: TrackerSettings, record: CommissioningRecord, noise: NoiseScale, walks: RandomWalks
) -> _Begun:
    rows = record.rows
    variance = noise_scale.variances(noise, rows[:, STD])
    unit = float(np.median(variance))
    passed = np.append(0.0, np.diff(rows[:, INDEX]))
    in_time = np.zeros(len(rows))
    series = np.column_stack(
        [rows[:, VALUE], variance, passed, in_time, rows[:, INDEX], rows[:, BATCH_CHANGE]]
    )
    slope_std = settings.slope_std * float(np.sqrt(variance[0]))
    first = run_length_bank.initial_bank(
        rows[0, VALUE], variance[0], slope_std, int(rows[0, INDEX]), settings.outlier_probability
    )
    model = BankModel(
        hazard=settings.hazard,
        step_variance=settings.step_std**2 * unit,
        level_variance=walks.level**2 * unit,
        slope_variance=walks.slope**2 * unit,
        outlier_probability=settings.outlier_probability,
        slope_prior=slope_std**2,
    )
    return _Begun(run_length_bank.workspace(first), len(first), model, series)


def identify_random_walks(
    settings: TrackerSettings, record: CommissioningRecord, noise: NoiseScale
) -> RandomWalks:
    """Find the random walks under which the record is clearly most likely."""

    @cache
    def likelihood(walks: RandomWalks) -> float:
        return _log_likelihood(settings, record, noise, walks)

    clearly = CLEARLY * variance_over_scatter(noise.variogram.correlation)
    best = RandomWalks(settings.level_noise, settings.slope_noise)
    for name, scales in (("level", LEVEL_WALKS), ("slope", SLOPE_WALKS)):
        none = best
        for scale in scales:
            tried = none._replace(**{name: scale})
            if likelihood(tried) > max(likelihood(best), likelihood(none) + clearly):
                best = tried
    return best


def step_variance(settings: TrackerSettings, variance: float, *, young: bool) -> float:
    """Prior variance of a step to a batch that is named; `young` before `EARLIEST_CHANGE` cycles."""
    return (settings.step_std * (FIRST_STEP if young else 1.0)) ** 2 * variance


def replay_filter(
    settings: TrackerSettings,
    record: CommissioningRecord,
    noise: NoiseScale,
    walks: RandomWalks,
    present: wear_filter.WearFilter,
) -> wear_filter.WearFilter:
    """Run the filter of known batches over the record, from where `present`, which is in use, was begun.

    That stays where no cycle of the record was named.
    """
    is_named = record.rows[:, BATCH] >= 0.0
    if not is_named.any():
        return present
    rows = record.rows[is_named]
    variances = noise_scale.variances(noise, rows[:, STD])
    unit = float(np.median(variances))
    names = [record.batches[int(place)] for place in rows[:, BATCH]]
    unnamed = int(np.argmax(is_named))
    is_first = (rows[:, INDEX] < rows[0, INDEX] + EARLIEST_CHANGE) & (rows[:, BATCH] == rows[0, BATCH])
    begun = 1 if unnamed else len(rows) if is_first.all() else int(np.argmin(is_first))
    if not unnamed and (rows[1:, BATCH] != rows[0, BATCH]).all():
        # the bank's moments of one value are mostly those of an outlier, as wide as a step
        slope_std = settings.slope_std * float(np.sqrt(variances[0]))
        state = wear_filter.initial_state(rows[0, VALUE], variances[0], slope_std, names[0])
    else:
        # cycles before the first that was named are the bank's, and say of wear what that makes of them
        first = record.rows[: unnamed + 1] if unnamed else rows[:begun]
        replayed = replay_bank(settings, replace(record, rows=first), noise, walks, int(first[0, INDEX]))
        moments = run_length_bank.moments(replayed.bank)
        is_beside = present.batches[0] is None
        state = (wear_filter.beside_reference if is_beside else wear_filter.from_bank)(*moments, names[0])
    followed = zip(rows[begun - 1 :], rows[begun:], variances[begun:], names[begun:], strict=False)
    for before, row, variance, name in followed:
        passed = int(row[INDEX] - before[INDEX])
        state = wear_filter.predict(state, passed, walks.level**2 * unit, walks.slope**2 * unit)
        if name != state.current:
            young = row[INDEX] < record.rows[0, INDEX] + EARLIEST_CHANGE
            state = wear_filter.switch_batch(state, name, step_variance(settings, variance, young=young))
        state, _ = wear_filter.update(state, row[VALUE], variance, settings.outlier_threshold)
    return state
