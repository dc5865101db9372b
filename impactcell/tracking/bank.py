"""Compiled bank of run-length hypotheses: when was the last batch change, and what follows from each answer.

Every hypothesis is a Kalman filter with state [total, slope, offset, shift]: the friction of the present
batch, its wear a cycle, its offset from the first batch and the last shift (offset minus the offset before).
Bayesian online change-point detection (Adams & MacKay 2007, arXiv:0710.3742) with wear shared by all
batches, a normal step prior, and measurements from a contaminated normal (Huber 1964).

The bank is one array, a row a hypothesis, oldest change first::

    column  0            1             2 .. 5                          6 .. 21
            log weight   change cycle  total, slope, offset, shift     4 x 4 covariance, by rows
"""

import math

import numpy as np

from impactcell.compiled import compiled
from impactcell.records import Samples

WEIGHT, CHANGE, MEAN, COVARIANCE, WIDTH = 0, 1, 2, 6, 22
OUTLIER_SCALE = 10.0  # an outlier's standard deviation in units of a good measurement's
CAPACITY = 76
ROWS = CAPACITY + 3
SMALL_STEP, LARGE_STEP = 0.4, 1.6  # of the prior's standard deviation, equally likely
CALIBRATION = 0.9
WINDOW = 1000.0  # cycles within which a change must be to be reported
RECENT = 16  # change cycles this recent are each kept
DROPPED_NATS = 30.0  # a hypothesis this far below the best is given up


@compiled
def _predict(bank: Samples, count: int, cycles: float, level_variance: float, slope_variance: float) -> None:
    """Let `cycles` pass: total and level grow by the slope, both walk at random."""
    for i in range(count):
        row = bank[i]
        row[2] += cycles * row[3]
        tt, ts, ss = row[6], row[7], row[11]
        row[6] = tt + cycles * (2.0 * ts + cycles * ss) + cycles * level_variance
        row[6] += slope_variance * cycles**3 / 3.0
        ts += cycles * ss + slope_variance * cycles**2 / 2.0
        to, td = row[8] + cycles * row[12], row[9] + cycles * row[13]
        row[7] = row[10] = ts
        row[8] = row[14] = to
        row[9] = row[18] = td
        row[11] = ss + slope_variance * cycles


@compiled
def _log_sum(bank: Samples, first: int, last: int) -> float:
    top = -np.inf
    for i in range(first, last):
        top = max(top, bank[i, 0])
    if top == -np.inf:
        return top
    total = 0.0
    for i in range(first, last):
        total += math.exp(bank[i, 0] - top)
    return top + math.log(total)


@compiled
def _merge(bank: Samples, first: int, last: int, into: Samples) -> None:
    """Write the moment-matched mixture of rows first..last-1 to `into`; weights add."""
    total = _log_sum(bank, first, last)
    mean, covariance = np.zeros(4), np.zeros((4, 4))
    heaviest = first
    for i in range(first, last):
        if bank[i, 0] > bank[heaviest, 0]:
            heaviest = i
        share = math.exp(bank[i, 0] - total)
        for a in range(4):
            mean[a] += share * bank[i, 2 + a]
    for i in range(first, last):
        share = math.exp(bank[i, 0] - total)
        for a in range(4):
            for b in range(4):
                spread = (bank[i, 2 + a] - mean[a]) * (bank[i, 2 + b] - mean[b])
                covariance[a, b] += share * (bank[i, 6 + 4 * a + b] + spread)
    change = bank[heaviest, 1]
    into[0], into[1] = total, change
    for a in range(4):
        into[2 + a] = mean[a]
        for b in range(4):
            into[6 + 4 * a + b] = covariance[a, b]


@compiled
def _spawn(bank: Samples, count: int, cycle: float, hazard: float, step_variance: float) -> int:
    """Add the hypotheses that a batch change came just before `cycle`; with `hazard` 1 there are no others.

    One for a small and one for a large step: their mixture has a higher peak and wider tails than a normal.
    """
    fresh = np.empty(22)
    _merge(bank, 0, count, fresh)
    if hazard < 1.0:
        for i in range(count):
            bank[i, 0] += math.log1p(-hazard)
        fresh[0] += math.log(hazard)
    else:
        count = 0
    # the new shift is independent of all before: total and offset both move by it
    fresh[0] += math.log(0.5)
    fresh[1] = cycle
    fresh[5] = 0.0
    for a in range(4):
        fresh[9 + 4 * a] = 0.0
        fresh[18 + a] = 0.0
    for scale in (SMALL_STEP, LARGE_STEP):
        variance = scale**2 * step_variance
        bank[count] = fresh
        row = bank[count]
        row[6] += variance
        row[8] += variance
        row[14] += variance
        row[16] += variance
        for a in (0, 2):
            row[9 + 4 * a] = variance
            row[18 + a] = variance
        row[21] = variance
        count += 1
    return count


@compiled
def _update(
    bank: Samples, count: int, value: float, variance: float, lag: float, cycle: float, outliers: float
) -> float:
    """Take one measurement, `lag` cycles old, into every row; return its log predictive density.

    Good with probability 1 - `outliers`, else 10 times as wide and then ignored; the two answers are
    merged by moments. A row whose change is later than `cycle` sees the batch before its shift.
    """
    total = 0.0
    before = _log_sum(bank, 0, count)
    g = np.empty(4)
    for i in range(count):
        row = bank[i]
        earlier = 1.0 if row[1] > cycle else 0.0
        for a in range(4):
            g[a] = row[6 + 4 * a] - lag * row[7 + 4 * a] - earlier * row[9 + 4 * a]
        own = g[0] - lag * g[1] - earlier * g[3]
        innovation = value - (row[2] - lag * row[3] - earlier * row[5])
        spread = own + variance
        wide = own + OUTLIER_SCALE**2 * variance
        good = math.log1p(-outliers) - 0.5 * (innovation**2 / spread + math.log(2.0 * math.pi * spread))
        odd = math.log(outliers) if outliers > 0.0 else -np.inf
        odd -= 0.5 * (innovation**2 / wide + math.log(2.0 * math.pi * wide))
        top = max(good, odd)
        likelihood = top + math.log(math.exp(good - top) + math.exp(odd - top))
        share = math.exp(good - likelihood)
        row[0] += likelihood
        shrink = share / spread - share * (1.0 - share) * (innovation / spread) ** 2
        for a in range(4):
            row[2 + a] += share * g[a] / spread * innovation
            for b in range(4):
                row[6 + 4 * a + b] -= shrink * g[a] * g[b]
    total = _log_sum(bank, 0, count)
    for i in range(count):
        bank[i, 0] -= total
    return total - before


@compiled
def _prune(bank: Samples, count: int, capacity: int, recent: int, cycle: float, accepted: float) -> int:
    """Drop hopeless rows, then merge neighbours, until `capacity` rows are left.

    The two merged are those closest together for their age, so that change cycles stay resolved to
    a fixed fraction of how long ago they are. Rows on the two sides of `accepted` are never merged.
    """
    top = -np.inf
    for i in range(count):
        top = max(top, bank[i, 0])
    kept = 0
    for i in range(count):
        if bank[i, 0] >= top - DROPPED_NATS or bank[i, 1] > cycle - recent:
            if kept != i:
                bank[kept] = bank[i]
            kept += 1
    while kept > capacity:
        best, cost = -1, np.inf
        for i in range(kept - 1):
            if (bank[i, 1] <= accepted) != (bank[i + 1, 1] <= accepted) or bank[i + 1, 1] > cycle - recent:
                continue
            gap = (bank[i + 1, 1] - bank[i, 1]) / (cycle - bank[i, 1] + 1.0)
            if gap < cost:
                best, cost = i, gap
        if best < 0:
            best = 0
        merged = np.empty(22)
        _merge(bank, best, best + 2, merged)
        bank[best] = merged
        for i in range(best + 1, kept - 1):
            bank[i] = bank[i + 1]
        kept -= 1
    return kept


@compiled
def _odds(bank: Samples, count: int, since: float, hazard: float) -> float:
    """Shiryaev-Roberts log statistic: changed after `since` against not, the prior odds taken out."""
    split = 0
    while split < count and bank[split, 1] <= since:
        split += 1
    if split == 0 or split == count:
        return -np.inf if split == count else np.inf
    return _log_sum(bank, split, count) - _log_sum(bank, 0, split) - math.log(hazard)


@compiled
def run_cycle(
    bank: Samples, count: int, design: Samples, reading: Samples, accepted: float
) -> tuple[int, float, float]:
    """Take one reading into the first `count` rows of `bank`, in place.

    Parameters
    ----------
    bank : ndarray, shape (at least capacity + 1, 22)
    design : ndarray
        capacity, recent, hazard a cycle, step variance, level and slope process variance a cycle,
        outlier probability.
    reading : ndarray
        value, variance, cycles passed (0 for one that came late), lag of a late one, its own cycle,
        1 if a batch change was announced just before it (0 if not, -1 if there is surely none).
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
    capacity, recent, hazard, step, level_q, slope_q, outliers = design
    value, variance, cycles, lag, cycle, announced = reading
    if cycles > 0.0:
        _predict(bank, count, cycles, level_q, slope_q)
        if announced > 0.0:
            count = _spawn(bank, count, cycle, 1.0, step)
        elif announced == 0.0:
            count = _spawn(bank, count, cycle, min(hazard * cycles, 0.5), step)
    density = _update(bank, count, value, variance, lag, cycle, outliers)
    count = _prune(bank, count, int(capacity), int(recent), cycle + lag, accepted)
    # only changes within the window count: over very long spans some tiny change is all but certain
    since = max(accepted, cycle + lag - WINDOW)
    return count, density, _odds(bank, count, since, hazard)


@compiled
def run_series(
    bank: Samples, count: int, design: Samples, readings: Samples, accepted: float
) -> tuple[int, float]:
    """Take readings, shape (n, 6), one after another, after that of `seed`; sum log densities."""
    total = 0.0
    for reading in readings[1:]:
        count, density, _ = run_cycle(bank, count, design, reading, accepted)
        total += density
    return count, total


def seed(value: float, variance: float, slope_std: float, cycle: int, outliers: float) -> Samples:
    """Make the bank of a first measurement: two rows, in case it is an outlier.

    Returns
    -------
    ndarray, shape (2, 22)
    """
    bank = np.zeros((2, WIDTH))
    for row, (probability, scale) in zip(
        bank, ((1.0 - outliers, 1.0), (outliers, OUTLIER_SCALE**2)), strict=True
    ):
        row[WEIGHT], row[CHANGE], row[MEAN] = math.log(probability), cycle, value
        row[COVARIANCE] = variance * scale
        row[COVARIANCE + 5] = slope_std**2
    return bank


def moments(bank: Samples) -> tuple[Samples, Samples]:
    """Mean, shape (4,), and covariance, shape (4, 4), of the whole mixture."""
    into = np.empty(WIDTH)
    _merge(bank.copy(), 0, len(bank), into)
    return into[MEAN:COVARIANCE].copy(), into[COVARIANCE:].reshape(4, 4).copy()


def design(
    hazard: float, step_variance: float, level_variance: float, slope_variance: float, outliers: float
) -> Samples:
    """Make the `design` of `run_cycle`."""
    return np.array([CAPACITY, RECENT, hazard, step_variance, level_variance, slope_variance, outliers])


def threshold(false_alarm_cycles: float) -> float:
    """Threshold of the log statistic for a mean number of cycles between false alarms.

    Without a change the statistic's exponential minus the number of cycles is a martingale (Pollak
    1985), so that the mean time to cross A is at least A; CALIBRATION takes back what the overshoot
    and the window give, measured without outliers.
    """
    return math.log(false_alarm_cycles) - CALIBRATION


def last_shift(bank: Samples, after: float, until: float) -> tuple[int, float, float]:
    """Most probable first cycle of the change in (after, until], its size and standard deviation."""
    rows = bank[(bank[:, CHANGE] > after) & (bank[:, CHANGE] <= until)]
    if len(rows) == 0:
        rows = bank
    best = int(rows[int(np.argmax(rows[:, WEIGHT])), CHANGE])
    mean, covariance = moments(rows)
    return best, float(mean[3]), math.sqrt(max(float(covariance[3, 3]), 0.0))
