"""What one cycle does to the rows of the bank: predict, spawn, update, merge.

Rows are those of `impactcell.tracking.wear_batch.run_length_bank`.
"""

import math

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import Samples

OUTLIER_SCALE = 10.0  # an outlier's standard deviation in units of a good measurement's
# mean, standard deviation and probability of a step up, down, a small one up, down, and a large one either
# way, in units of the prior's standard deviation, which is that of all of them together
STEPS = (
    (0.6, 0.25, 0.25),
    (-0.6, 0.25, 0.25),
    (0.12, 0.035, 0.22),
    (-0.12, 0.035, 0.22),
    (0.0, 3.61, 0.06),
)
# scales on which wear may go on, all as likely, in units of the slope's prior standard deviation: one normal
# prior wide enough for the fastest would let a small step pass for wear until there have been many cycles
SLOPES = (1.0, 0.3, 0.03, 0.003)
DROPPED_NATS = 30.0  # a hypothesis this far below the best is given up


@compiled
def predict(bank: Samples, count: int, cycles: float, level_variance: float, slope_variance: float) -> None:
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
def log_sum_exp(bank: Samples, first: int, last: int) -> float:
    """Logarithm of the weight of rows first..last-1 together."""
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
def merge(bank: Samples, first: int, last: int, into: Samples) -> None:
    """Write the moment-matched mixture of rows first..last-1 to `into`; weights add."""
    total = log_sum_exp(bank, first, last)
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
def spawn(bank: Samples, count: int, cycle: float, hazard: float, step_variance: float) -> int:
    """Add the hypotheses that a batch change came just before `cycle`; with `hazard` 1 there are no others.

    One for each of `STEPS`: steps of half a standard deviation of an estimate, which take the most cycles
    to find, have a share of their own, for a prior that is flat in size leaves them nearly nothing; its
    tails are wide, so that none waits long for its likelihood.
    """
    fresh = np.empty(22)
    merge(bank, 0, count, fresh)
    if hazard < 1.0:
        for i in range(count):
            bank[i, 0] += math.log1p(-hazard)
        fresh[0] += math.log(hazard)
    else:
        count = 0
    # the new shift is independent of all before: total and offset both move by it
    fresh[1] = cycle
    for a in range(4):
        fresh[9 + 4 * a] = 0.0
        fresh[18 + a] = 0.0
    for mean, std, share in STEPS:
        step = mean * math.sqrt(step_variance)
        variance = std**2 * step_variance
        bank[count] = fresh
        row = bank[count]
        row[0] += math.log(share)
        row[2] += step
        row[4] += step
        row[5] = step
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
def update(
    bank: Samples, count: int, value: float, variance: float, lag: float, cycle: float, outliers: float
) -> tuple[float, float]:
    """Take one measurement, `lag` cycles old, into every row.

    Good with probability 1 - `outliers`, else 10 times as wide and then ignored; the two answers are
    merged by moments. A row whose change is later than `cycle` sees the batch before its shift.

    Returns
    -------
    log_density : float
        Of the measurement, before it was known.
    odd_share : float
        Probability, now, that it is an outlier.
    """
    before = log_sum_exp(bank, 0, count)
    g, good_share = np.empty(4), np.empty(count)
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
        good_share[i] = share
        shrink = share / spread - share * (1.0 - share) * (innovation / spread) ** 2
        for a in range(4):
            row[2 + a] += share * g[a] / spread * innovation
            for b in range(4):
                row[6 + 4 * a + b] -= shrink * g[a] * g[b]
    total, odd_share = log_sum_exp(bank, 0, count), 0.0
    for i in range(count):
        bank[i, 0] -= total
        odd_share += math.exp(bank[i, 0]) * (1.0 - good_share[i])
    return total - before, odd_share


@compiled
def prune(bank: Samples, count: int, capacity: int, recent: int, cycle: float, accepted: float) -> int:
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
        merge(bank, best, best + 2, merged)
        bank[best] = merged
        for i in range(best + 1, kept - 1):
            bank[i] = bank[i + 1]
        kept -= 1
    return kept


@compiled
def slope_evidence(mean: float, variance: float, prior: float) -> float:
    """Log factor on the evidence of a row when its slope's prior is the mixture over `SLOPES`.

    The row was filtered with N(0, `prior`) and has its slope at N(`mean`, `variance`); what the data
    alone say is their ratio, and its integral over each scale is in closed form.
    """
    if variance >= 0.99 * prior:
        return 0.0
    own = 1.0 / (1.0 / variance - 1.0 / prior)
    square = (mean * own / variance) ** 2
    flat = own + prior
    total = 0.0
    for scale in SLOPES:
        wide = own + scale**2 * prior
        total += math.exp(-0.5 * square * (1.0 / wide - 1.0 / flat)) * math.sqrt(flat / wide)
    return math.log(total / len(SLOPES))


@compiled
def shiryaev_roberts(bank: Samples, count: int, since: float, hazard: float, slope_prior: float) -> float:
    """Shiryaev-Roberts log statistic: changed after `since` against not, the prior odds taken out."""
    split = 0
    while split < count and bank[split, 1] <= since:
        split += 1
    if split == 0 or split == count:
        return -np.inf if split == count else np.inf
    weighed = np.empty((count, 1))
    for i in range(count):
        weighed[i, 0] = bank[i, 0] + slope_evidence(bank[i, 3], bank[i, 11], slope_prior)
    return log_sum_exp(weighed, split, count) - log_sum_exp(weighed, 0, split) - math.log(hazard)
