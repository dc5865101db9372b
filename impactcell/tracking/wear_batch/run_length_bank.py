"""Compiled bank of run-length hypotheses: when was the last batch change, and what follows from each answer.

Every hypothesis is a Kalman filter with state [total, slope, offset, shift]: the friction of the present
batch, its wear a cycle, its offset from the first batch and the last shift (offset minus the offset before).
Bayesian online change-point detection (Adams & MacKay 2007, arXiv:0710.3742) with wear shared by all
batches, a prior of steps up and down, small and large, and measurements from a contaminated normal
(Huber 1964).

The bank is one array, a row a hypothesis, oldest change first::

    column  0            1             2 .. 5                          6 .. 21
            log weight   change cycle  total, slope, offset, shift     4 x 4 covariance, by rows
"""

import math

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import Samples
from impactcell.tracking.wear_batch import run_length_update

WEIGHT, CHANGE, MEAN, COVARIANCE, WIDTH = 0, 1, 2, 6, 22
CAPACITY = 100
ROWS = CAPACITY + len(run_length_update.STEPS) + 1
CALIBRATION = 0.60
WINDOW = 1000.0  # cycles within which a change must be to be reported
RECENT = 10  # change cycles this recent are each kept
EXPECTED_CYCLES = 100.0  # cycles that the prior probability of an outlier counts for
MEMORY = 5000.0  # cycles after which outliers are forgotten
MOST_OUTLIERS = 0.1  # where there seem to be more, they are no outliers


@compiled
def outlier_probability(prior: float, seen: float, cycles: float) -> float:
    """Posterior mean of the probability of an outlier after `seen` of them in `cycles` (beta prior)."""
    return min((prior * EXPECTED_CYCLES + seen) / (EXPECTED_CYCLES + cycles), MOST_OUTLIERS)


@compiled
def update(
    bank: Samples, count: int, design: Samples, reading: Samples, outliers: Samples, accepted: float
) -> tuple[int, float, float]:
    """Take one reading into the first `count` rows of `bank`, in place.

    Parameters
    ----------
    bank : ndarray, shape (ROWS, 22)
    design : ndarray
        hazard a cycle, step variance, level and slope process variance a cycle, prior probability of
        an outlier, prior variance of the slope.
    reading : ndarray
        value, variance, cycles passed (0 for one that came late), lag of a late one, its own cycle,
        1 if a batch change was announced just before it (0 if not, -1 if there is surely none).
    outliers : ndarray, shape (2,)
        Outliers seen so far, in how many cycles; changed in place.
    accepted : float
        Changes up to this cycle have been reported.

    Returns
    -------
    count : int
    log_density : float
        Log predictive density of the value.
    statistic : float
        Shiryaev-Roberts log statistic of a change after `accepted`.
    """
    hazard, step, level_q, slope_q, prior, slope = design
    value, variance, cycles, lag, cycle, announced = reading
    if cycles > 0.0:
        run_length_update.predict(bank, count, cycles, level_q, slope_q)
        if announced > 0.0:
            count = run_length_update.spawn(bank, count, cycle, 1.0, step)
        elif announced == 0.0:
            count = run_length_update.spawn(bank, count, cycle, min(hazard * cycles, 0.5), step)
    probability = outlier_probability(prior, outliers[0], outliers[1])
    density, odd = run_length_update.update(bank, count, value, variance, lag, cycle, probability)
    kept = 1.0 - 1.0 / MEMORY
    outliers[0], outliers[1] = kept * outliers[0] + odd, kept * outliers[1] + 1.0
    count = run_length_update.prune(bank, count, CAPACITY, RECENT, cycle + lag, accepted)
    # only changes within the window count: over very long spans some tiny change is all but certain
    since = max(accepted, cycle + lag - WINDOW)
    return count, density, run_length_update.shiryaev_roberts(bank, count, since, hazard, slope)


@compiled
def update_series(
    bank: Samples, count: int, design: Samples, readings: Samples, outliers: Samples, accepted: float
) -> tuple[int, float]:
    """Take readings, shape (n, 6), one after another, after that of `initial_bank`; sum log densities."""
    total = 0.0
    for reading in readings[1:]:
        count, density, _ = update(bank, count, design, reading, outliers, accepted)
        total += density
    return count, total


def initial_bank(value: float, variance: float, slope_std: float, cycle: int, outliers: float) -> Samples:
    """Make the bank of a first measurement: two rows, in case it is an outlier.

    Returns
    -------
    ndarray, shape (2, 22)
    """
    bank = np.zeros((2, WIDTH))
    for row, (probability, scale) in zip(
        bank, ((1.0 - outliers, 1.0), (outliers, run_length_update.OUTLIER_SCALE**2)), strict=True
    ):
        row[WEIGHT], row[CHANGE], row[MEAN] = math.log(probability), cycle, value
        row[COVARIANCE] = variance * scale
        row[COVARIANCE + 5] = slope_std**2
    return bank


def moments(bank: Samples) -> tuple[Samples, Samples]:
    """Mean, shape (4,), and covariance, shape (4, 4), of the whole mixture."""
    into = np.empty(WIDTH)
    run_length_update.merge(bank.copy(), 0, len(bank), into)
    return into[MEAN:COVARIANCE].copy(), into[COVARIANCE:].reshape(4, 4).copy()


def design(
    hazard: float,
    step_variance: float,
    level_variance: float,
    slope_variance: float,
    outliers: float,
    slope_prior: float,
) -> Samples:
    """Make the `design` of `update`."""
    return np.array([hazard, step_variance, level_variance, slope_variance, outliers, slope_prior])


def threshold(false_alarm_cycles: float) -> float:
    """Threshold of the log statistic for a mean number of cycles between false alarms.

    Without a change the statistic's exponential minus the number of cycles is a martingale (Pollak
    1985), so that the mean time to cross A is at least A; CALIBRATION takes back what the overshoot
    and the window give, measured without outliers.
    """
    return math.log(false_alarm_cycles) - CALIBRATION


def locate_change_point(bank: Samples, after: float, until: float) -> tuple[int, float, float]:
    """Most probable first cycle of the change in (after, until], its size and standard deviation."""
    rows = bank[(bank[:, CHANGE] > after) & (bank[:, CHANGE] <= until)]
    if len(rows) == 0:
        rows = bank
    best = int(rows[int(np.argmax(rows[:, WEIGHT])), CHANGE])
    mean, covariance = moments(rows)
    return best, float(mean[3]), math.sqrt(max(float(covariance[3, 3]), 0.0))
