"""Compiled bank of run-length hypotheses: when was the last batch change, and what follows from each answer.

Every hypothesis is a Kalman filter with state [total, slope, offset, shift]: the friction of the present
batch, its wear a cycle, its offset from the first batch and the last shift (offset minus the offset before).
Bayesian online change-point detection (Adams & MacKay 2007, arXiv:0710.3742) with wear shared by all
batches, a prior of steps up and down, small and large, and measurements from a contaminated normal
(Huber 1964).

Between cycles the bank is an array of floats, a row a hypothesis, oldest change first; compiled functions see
the same numbers as records with names, see `run_length_model.HYPOTHESIS`::

    column  0           1             2 .. 5                          6 .. 21
            log weight  change cycle  mean: total, slope, ...         4 x 4 covariance, by rows
"""

import math
from typing import NamedTuple

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import Samples
from impactcell.tracking.wear_batch import run_length_update
from impactcell.tracking.wear_batch.run_length_model import (
    HYPOTHESIS,
    SLOPE,
    STEPS,
    Bank,
    BankModel,
    BankMoments,
    Measurement,
)
from impactcell.tracking.wear_batch.run_length_update import CAPACITY

WIDTH = HYPOTHESIS.itemsize // 8
"""Numbers of one hypothesis."""
ROWS = CAPACITY + len(STEPS) + 1
"""Hypotheses that there can be within a cycle, before the bank is pruned."""
EMPTY = np.zeros((0, WIDTH))
"""No hypothesis."""
CALIBRATION = 0.60
"""What the overshoot over the threshold, and `WINDOW`, take off it; nats, measured without outliers."""
WINDOW = 1000.0
"""Cycles within which a change must be to be reported: over very long spans some tiny change is all but
certain."""
EXPECTED_CYCLES = 100.0
"""Cycles that the prior probability of an outlier counts for (beta prior)."""
MEMORY = 5000.0
"""Cycles after which outliers are forgotten."""
MOST_OUTLIERS = 0.1
"""Where there seem to be more than this share, they are no outliers."""
FIRST_OUTLIER_SCALE = 100.0
"""Standard deviation of the friction about a first measurement that is an outlier, in those of a good one.
Nothing else tells of it yet: by that of other outliers one farther off would be a batch of its own."""


class BankResult(NamedTuple):
    """Outcome of one measurement.

    Attributes
    ----------
    hypotheses : int
        How many there are now.
    log_density : float
        Log predictive density of the value.
    statistic : float
        Shiryaev-Roberts log statistic of a change after the last that was accepted.
    outlier_share : float
        Probability, now, that the measurement is an outlier.
    """

    hypotheses: int
    log_density: float
    statistic: float
    outlier_share: float


@compiled
def outlier_probability(prior: float, seen: float, cycles: float) -> float:
    """Posterior mean of the probability of an outlier after `seen` of them in `cycles` (beta prior)."""
    return min((prior * EXPECTED_CYCLES + seen) / (EXPECTED_CYCLES + cycles), MOST_OUTLIERS)


@compiled
def take(
    bank: Bank, count: int, model: BankModel, measurement: Measurement, outliers: Samples, accepted: float
) -> tuple[int, float, float]:
    """Take one measurement into the first `count` hypotheses of `bank`, in place.

    Parameters
    ----------
    bank : array of HYPOTHESIS, shape (ROWS,)
    model : BankModel
    measurement : Measurement
    outliers : ndarray, shape (2,)
        Outliers seen so far, in how many cycles; changed in place.
    accepted : float
        Changes up to this cycle have been reported.

    Returns
    -------
    hypotheses : int
    log_density, outlier_share : float
        As in `BankResult`.
    """
    cycles, announced = measurement.cycles, measurement.announced
    if cycles > 0.0:
        run_length_update.predict(bank, count, cycles, model)
        step, cycle = model.step_variance, measurement.cycle
        if announced > 0.0:
            count = run_length_update.spawn(bank, count, cycle, 1.0, step)
        elif announced == 0.0:
            hazard = min(model.hazard * cycles, 0.5)
            count = run_length_update.spawn(bank, count, cycle, hazard, step)
    probability = outlier_probability(model.outlier_probability, outliers[0], outliers[1])
    density, outlier_share = run_length_update.update(bank, count, measurement, probability)
    kept = 1.0 - 1.0 / MEMORY
    outliers[0], outliers[1] = kept * outliers[0] + outlier_share, kept * outliers[1] + 1.0
    count = run_length_update.prune(bank, count, measurement.cycle + measurement.lag, accepted, CAPACITY)
    return count, density, outlier_share


@compiled
def update(
    bank: Bank, count: int, model: BankModel, measurement: Measurement, outliers: Samples, accepted: float
) -> BankResult:
    """Take one measurement as `take`, and say what it makes of a change after the last that was accepted."""
    count, density, outlier_share = take(bank, count, model, measurement, outliers, accepted)
    changed, unchanged = change_weights(bank, count, model, measurement, accepted)
    statistic = changed - unchanged - math.log(model.hazard) if unchanged > -np.inf else np.inf
    return BankResult(count, density, statistic, outlier_share)


@compiled
def settled_until(measurement: Measurement, accepted: float) -> float:
    """Cycle up to which changes are no longer reported: the last that was, or what is too long ago."""
    return max(accepted, measurement.cycle + measurement.lag - WINDOW)


@compiled
def change_weights(
    bank: Bank, count: int, model: BankModel, measurement: Measurement, accepted: float
) -> tuple[float, float]:
    """Log weights of a change since the last that was accepted, and of none, after a measurement."""
    since = settled_until(measurement, accepted)
    return run_length_update.change_weights(bank, count, since, model.slope_prior)


@compiled
def update_series(
    bank: Bank, count: int, model: BankModel, series: Samples, outliers: Samples, accepted: float
) -> tuple[int, float]:
    """Take in the rows of a series, shape (n, 6), but for the first; sum log densities."""
    total = 0.0
    for row in series[1:]:
        measurement = Measurement(row[0], row[1], row[2], row[3], row[4], row[5])
        count, log_density, _ = take(bank, count, model, measurement, outliers, accepted)
        total += log_density
    return count, total


def workspace(rows: Samples, room: int = ROWS) -> Bank:
    """Give the hypotheses of a stored bank, shape (k, 22), with room for more, shape (room,)."""
    table = np.empty((room, WIDTH))  # copied as floats: numpy copies records field by field
    table[: len(rows)] = rows
    return records(table)


def stored(bank: Bank, count: int) -> Samples:
    """Give the first `count` hypotheses as rows to be kept, shape (count, 22)."""
    return np.ndarray((count, WIDTH), np.float64, bank).copy()


def initial_bank(value: float, variance: float, slope_std: float, cycle: int, outliers: float) -> Samples:
    """Make the bank of a first measurement: two rows, in case it is an outlier.

    Returns
    -------
    ndarray, shape (2, 22)
    """
    bank = np.zeros(2, HYPOTHESIS)
    bank["log_weight"] = math.log(1.0 - outliers), math.log(outliers)
    bank["change_cycle"], bank["mean"][:, 0] = cycle, value
    bank["covariance"][:, 0, 0] = variance, variance * FIRST_OUTLIER_SCALE**2
    bank["covariance"][:, SLOPE, SLOPE] = slope_std**2
    return stored(bank, 2)


def moments(rows: Samples) -> tuple[Samples, Samples]:
    """Mean, shape (4,), and covariance, shape (4, 4), of the whole mixture."""
    mixture = np.empty(1, HYPOTHESIS)
    run_length_update.merge(records(rows), 0, len(rows), mixture)
    return mixture["mean"][0], mixture["covariance"][0]


def wear_moments(rows: Samples) -> BankMoments:
    """Of `moments`, those that tell of wear and batch, without the arrays."""
    return run_length_update.wear_moments(records(rows))


def threshold(false_alarm_cycles: float) -> float:
    """Threshold of the log statistic for a mean number of cycles between false alarms.

    Without a change the statistic's exponential minus the number of cycles is a martingale (Pollak
    1985), so that the mean time to cross A is at least A; `CALIBRATION` is what is measured beyond.
    """
    return math.log(false_alarm_cycles) - CALIBRATION


def locate_change_point(rows: Samples, after: float, until: float) -> tuple[int, float, float]:
    """Most probable first cycle of the change in (after, until], its size and standard deviation.

    Both nan where no hypothesis of a change in there is left.
    """
    cycle, size, variance = run_length_update.change_within(records(rows), float(after), float(until))
    return int(cycle), size, math.sqrt(max(variance, 0.0))


def records(rows: Samples) -> Bank:
    """Give the hypotheses of a stored bank, shape (k,), on the same numbers."""
    return np.ndarray(len(rows), HYPOTHESIS, rows)
