"""What one cycle does to the hypotheses of the bank: predict, spawn, update, merge, prune; and what they say.

Hypotheses are records of `HYPOTHESIS`, oldest change first; functions change the first `count` in place.
Why there are such, and the model behind them: `impactcell.tracking.wear_batch.run_length_bank`.
"""

import math

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.tracking.wear_batch.run_length_model import (
    OFFSET,
    OUTLIER_SCALE,
    SHIFT,
    SLOPE,
    SLOPES,
    STATES,
    STEPS,
    TOTAL,
    Bank,
    BankModel,
    BankMoments,
    Measurement,
)

CAPACITY = 100
"""Hypotheses that are kept from cycle to cycle; more give no better delays, and cost time in proportion."""
RECENT = 10.0
"""Change cycles this recent are each kept, so that a step just found is placed to the cycle; cycles."""
DROPPED_NATS = 30.0
"""Log weight below that of the best at which a hypothesis is given up: its share is below 1e-13."""
UNINFORMED = 0.99
"""Share of its prior variance above which the slope's variance says that the data have told nothing of it."""


@compiled
def predict(bank: Bank, count: int, cycles: float, model: BankModel) -> None:
    """Let `cycles` pass: total and level grow by the slope, both walk at random."""
    for i in range(count):
        mean, covariance = bank[i].mean, bank[i].covariance
        mean[TOTAL] += cycles * mean[SLOPE]
        total_slope, slope = covariance[TOTAL, SLOPE], covariance[SLOPE, SLOPE]
        covariance[TOTAL, TOTAL] = (
            covariance[TOTAL, TOTAL]
            + cycles * (2.0 * total_slope + cycles * slope)
            + cycles * model.level_variance
        )
        covariance[TOTAL, TOTAL] += model.slope_variance * cycles**3 / 3.0
        total_slope += cycles * slope + model.slope_variance * cycles**2 / 2.0
        total_offset = covariance[TOTAL, OFFSET] + cycles * covariance[SLOPE, OFFSET]
        total_shift = covariance[TOTAL, SHIFT] + cycles * covariance[SLOPE, SHIFT]
        covariance[TOTAL, SLOPE] = covariance[SLOPE, TOTAL] = total_slope
        covariance[TOTAL, OFFSET] = covariance[OFFSET, TOTAL] = total_offset
        covariance[TOTAL, SHIFT] = covariance[SHIFT, TOTAL] = total_shift
        covariance[SLOPE, SLOPE] = slope + model.slope_variance * cycles


@compiled
def log_sum_exp(bank: Bank, first: int, last: int) -> float:
    """Logarithm of the weight of hypotheses first..last-1 together."""
    top = -np.inf
    for i in range(first, last):
        top = max(top, bank[i].log_weight)
    if top == -np.inf:
        return top
    total = 0.0
    for i in range(first, last):
        total += math.exp(bank[i].log_weight - top)
    return top + math.log(total)


@compiled
def merge(bank: Bank, first: int, last: int, into: Bank) -> None:
    """Write the moment-matched mixture of hypotheses first..last-1 to the one of `into`; weights add."""
    total = log_sum_exp(bank, first, last)
    mean, covariance = np.zeros(STATES), np.zeros((STATES, STATES))
    shares, heaviest = np.empty(last - first), first
    for i in range(first, last):
        if bank[i].log_weight > bank[heaviest].log_weight:
            heaviest = i
        share = shares[i - first] = math.exp(bank[i].log_weight - total)
        for a in range(STATES):
            mean[a] += share * bank[i].mean[a]
    for i in range(first, last):
        share = shares[i - first]
        for a in range(STATES):
            for b in range(STATES):
                between = (bank[i].mean[a] - mean[a]) * (bank[i].mean[b] - mean[b])
                covariance[a, b] += share * (bank[i].covariance[a, b] + between)
    merged = into[0]
    merged.log_weight, merged.change_cycle = total, bank[heaviest].change_cycle
    for a in range(STATES):
        merged.mean[a] = mean[a]
        for b in range(STATES):
            merged.covariance[a, b] = covariance[a, b]


@compiled
def wear_moments(bank: Bank) -> BankMoments:
    """Moments of the whole mixture that tell of wear and batch."""
    mixture = np.empty(1, bank.dtype)
    merge(bank, 0, len(bank), mixture)
    mean, covariance = mixture[0].mean, mixture[0].covariance
    return BankMoments(
        mean[TOTAL],
        mean[SLOPE],
        mean[OFFSET],
        covariance[TOTAL, TOTAL],
        covariance[TOTAL, SLOPE],
        covariance[TOTAL, OFFSET],
        covariance[SLOPE, SLOPE],
        covariance[SLOPE, OFFSET],
        covariance[OFFSET, OFFSET],
    )


@compiled
def change_within(bank: Bank, after: float, until: float) -> tuple[float, float, float]:
    """Give the most probable change in (after, until], its size and variance; both nan where none is left."""
    first, last = 0, len(bank)
    while first < last and bank[first].change_cycle <= after:
        first += 1
    while last > first and bank[last - 1].change_cycle > until:
        last -= 1
    if first == last:
        return until, np.nan, np.nan
    mixture = np.empty(1, bank.dtype)
    merge(bank, first, last, mixture)
    found = mixture[0]
    return found.change_cycle, found.mean[SHIFT], found.covariance[SHIFT, SHIFT]


@compiled
def spawn(bank: Bank, count: int, cycle: float, hazard: float, step_variance: float) -> int:
    """Add the hypotheses that a batch change came just before `cycle`; with `hazard` 1 there are no others.

    One for each of `STEPS`: steps of half a standard deviation of an estimate, which take the most cycles
    to find, have a share of their own, for a prior that is flat in size leaves them nearly nothing; its
    tails are wide, so that none waits long for its likelihood.
    """
    before = np.empty(1, bank.dtype)
    merge(bank, 0, count, before)
    if hazard < 1.0:
        log_same = math.log1p(-hazard)
        for i in range(count):
            bank[i].log_weight += log_same
        before[0].log_weight += math.log(hazard)
    else:
        count = 0
    # the new shift is independent of all before: total and offset both move by it
    before[0].change_cycle = cycle
    for a in range(STATES):
        before[0].covariance[a, SHIFT] = 0.0
        before[0].covariance[SHIFT, a] = 0.0
    for mean, std, share in STEPS:
        step = mean * math.sqrt(step_variance)
        variance = std**2 * step_variance
        bank[count] = before[0]
        changed = bank[count]
        changed.log_weight += math.log(share)
        changed.mean[TOTAL] += step
        changed.mean[OFFSET] += step
        changed.mean[SHIFT] = step
        covariance = changed.covariance
        covariance[TOTAL, TOTAL] += variance
        covariance[TOTAL, OFFSET] += variance
        covariance[OFFSET, TOTAL] += variance
        covariance[OFFSET, OFFSET] += variance
        for a in (TOTAL, OFFSET):
            covariance[a, SHIFT] = variance
            covariance[SHIFT, a] = variance
        covariance[SHIFT, SHIFT] = variance
        count += 1
    return count


@compiled
def update(bank: Bank, count: int, measurement: Measurement, outliers: float) -> tuple[float, float]:
    """Take one measurement into every hypothesis.

    Good with probability 1 - `outliers`, else `OUTLIER_SCALE` times as wide and then ignored; the two
    answers are merged by moments. Where the change is later than the measurement, the batch before counts.

    Returns
    -------
    log_density : float
        Of the measurement, before it was known.
    outlier_share : float
        Probability, now, that it is an outlier.
    """
    variance, lag = measurement.variance, measurement.lag
    before = log_sum_exp(bank, 0, count)
    gain, good_share = np.empty(STATES), np.empty(count)
    log_good = math.log1p(-outliers)
    log_outlying = math.log(outliers) if outliers > 0.0 else -np.inf
    for i in range(count):
        mean, covariance = bank[i].mean, bank[i].covariance
        earlier = 1.0 if bank[i].change_cycle > measurement.cycle else 0.0
        for a in range(STATES):
            gain[a] = covariance[a, TOTAL] - lag * covariance[a, SLOPE] - earlier * covariance[a, SHIFT]
        predicted = gain[TOTAL] - lag * gain[SLOPE] - earlier * gain[SHIFT]
        innovation = measurement.value - (mean[TOTAL] - lag * mean[SLOPE] - earlier * mean[SHIFT])
        narrow = predicted + variance
        wide = predicted + OUTLIER_SCALE**2 * variance
        good = log_good - 0.5 * (innovation**2 / narrow + math.log(2.0 * math.pi * narrow))
        outlying = log_outlying - 0.5 * (innovation**2 / wide + math.log(2.0 * math.pi * wide))
        likelihood = max(good, outlying) + math.log(1.0 + math.exp(-abs(good - outlying)))
        share = math.exp(good - likelihood)
        bank[i].log_weight += likelihood
        good_share[i] = share
        shrink = share / narrow - share * (1.0 - share) * (innovation / narrow) ** 2
        for a in range(STATES):
            mean[a] += share * gain[a] / narrow * innovation
            for b in range(STATES):
                covariance[a, b] -= shrink * gain[a] * gain[b]
    total, outlier_share = log_sum_exp(bank, 0, count), 0.0
    for i in range(count):
        bank[i].log_weight -= total
        outlier_share += math.exp(bank[i].log_weight) * (1.0 - good_share[i])
    return total - before, outlier_share


@compiled
def prune(bank: Bank, count: int, cycle: float, accepted: float, capacity: int) -> int:
    """Drop hopeless hypotheses, then merge neighbours, until `capacity` are left.

    The two merged are those closest together for their age, so that change cycles stay resolved to
    a fixed fraction of how long ago they are. Those on the two sides of `accepted` are never merged.
    """
    top = -np.inf
    for i in range(count):
        top = max(top, bank[i].log_weight)
    kept = 0
    for i in range(count):
        if bank[i].log_weight >= top - DROPPED_NATS or bank[i].change_cycle > cycle - RECENT:
            if kept != i:
                bank[kept] = bank[i]
            kept += 1
    merged = np.empty(1, bank.dtype)
    while kept > capacity:
        closest, least = 0, np.inf
        for i in range(kept - 1):
            older, newer = bank[i].change_cycle, bank[i + 1].change_cycle
            if (older <= accepted) != (newer <= accepted) or newer > cycle - RECENT:
                continue
            distance = (newer - older) / (cycle - older + 1.0)
            if distance < least:
                closest, least = i, distance
        merge(bank, closest, closest + 2, merged)
        bank[closest] = merged[0]
        for i in range(closest + 1, kept - 1):
            bank[i] = bank[i + 1]
        kept -= 1
    return kept


@compiled
def slope_evidence(mean: float, variance: float, prior: float) -> float:
    """Log factor on the evidence of a hypothesis when its slope's prior is the mixture over `SLOPES`.

    It was filtered with N(0, `prior`) and has its slope at N(`mean`, `variance`); what the data alone
    say is their ratio, and its integral over each scale is in closed form.
    """
    if variance >= UNINFORMED * prior:
        return 0.0
    likelihood = 1.0 / (1.0 / variance - 1.0 / prior)
    square = (mean * likelihood / variance) ** 2
    flat = likelihood + prior
    total = 0.0
    for scale in SLOPES:
        wide = likelihood + scale**2 * prior
        total += math.exp(-0.5 * square * (1.0 / wide - 1.0 / flat)) * math.sqrt(flat / wide)
    return math.log(total / len(SLOPES))


@compiled
def weight_by_slopes(bank: Bank, first: int, last: int, slope_prior: float) -> float:
    """Log weight of hypotheses first..last-1 together when the slope's prior is the mixture over `SLOPES`."""
    weighted = np.empty(last - first, bank.dtype)
    for i in range(first, last):
        evidence = slope_evidence(bank[i].mean[SLOPE], bank[i].covariance[SLOPE, SLOPE], slope_prior)
        weighted[i - first].log_weight = bank[i].log_weight + evidence
    return log_sum_exp(weighted, 0, last - first)


@compiled
def change_weights(bank: Bank, count: int, since: float, slope_prior: float) -> tuple[float, float]:
    """Log weights of all that say a change came after `since`, and of all that say none did."""
    split = 0
    while split < count and bank[split].change_cycle <= since:
        split += 1
    changed = weight_by_slopes(bank, split, count, slope_prior)
    return changed, weight_by_slopes(bank, 0, split, slope_prior)
