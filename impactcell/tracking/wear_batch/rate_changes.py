"""Hypotheses that wear goes on at another rate since some cycle, beside those that the batch has changed.

A surface that runs in wears fast and then slowly; towards its end it is the other way round. To whoever knows
steady wear and batches only, such a bend is a step of the batch. So each cycle may be the first of another
rate: level and offset go on, the slope is drawn anew from N(0, slope² - `SEEN`² var(slope)), for wear that
has been seen rarely goes on many times as fast. These hypotheses are weighed against `run_length_bank`'s in
the same way (Adams & MacKay 2007, arXiv:0710.3742), and are rows of the same kind; `change_cycle` is the
first cycle of the rate. In none of them has the batch changed since the last change that was reported.

Wear that has not been seen yet has no rate that could change: a slope that may turn into any other explains
small steps of the batch for hundreds of cycles, which would be found so much later. Nor has very slow wear:
in the cycles in which a change of batch is looked for (`run_length_bank.WINDOW`) it bends by less than a
standard deviation of an estimate. Wear that becomes more than some four times as fast is beyond that prior,
and a change of batch.
"""

import math
from typing import NamedTuple

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import Samples
from impactcell.tracking.wear_batch import run_length_bank, run_length_update
from impactcell.tracking.wear_batch.run_length_model import (
    OFFSET,
    SHIFT,
    SLOPE,
    STATES,
    TOTAL,
    Bank,
    BankModel,
    Measurement,
)

CYCLE = Measurement._fields.index("cycle")
"""Its column in a series."""
CAPACITY = 24
"""Hypotheses that are kept from cycle to cycle: when a bend began need not be known to the cycle."""
ROWS = CAPACITY + 1
"""Hypotheses that there can be within a cycle, before they are pruned."""
RATE_HAZARD = 0.1
"""Prior probability of another rate a cycle, in those of another batch."""
YOUNG = 300.0
"""Cycles in which a surface runs in, and in which wear whose rate has changed may go on doing so, ..."""
YOUNG_HAZARD = 1.0
"""... where another rate is as probable as another batch."""
SEEN = 3.0
"""Standard deviations from nought beyond which a slope has been seen."""
STEEP = 0.01
"""Slope, in standard deviations of its prior, below which a bend is too slight to pass for a step."""


class BankOutcome(NamedTuple):
    """What became of one measurement in the bank.

    Attributes
    ----------
    outlier_probability : float
        Before the measurement.
    log_density : float
        Log predictive density of the measurement.
    since : float
        Cycle up to which changes of the batch are settled.
    begun : float
        The first cycle, or that at which the last change of rate was found.
    """

    outlier_probability: float
    log_density: float
    since: float
    begun: float


class Statistics(NamedTuple):
    """Shiryaev-Roberts log statistics since the last change of batch that was reported.

    Attributes
    ----------
    batch, rate : float
        Of another batch, and of another rate, each against all else.
    batch_over_rate : float
        Of another batch against another rate alone.
    """

    batch: float
    rate: float
    batch_over_rate: float


@compiled
def take(
    rates: Bank, count: int, before: Bank, model: BankModel, measurement: Measurement, in_bank: BankOutcome
) -> int:
    """Take one measurement into the first `count` hypotheses of `rates`, in place; say how many there are.

    Parameters
    ----------
    rates : array of HYPOTHESIS, shape (ROWS,)
    before : array of HYPOTHESIS
        The bank before the measurement.
    """
    cycles = measurement.cycles
    if cycles <= 0.0:  # one that comes late says nothing of the rate now
        return count
    run_length_update.predict(rates, count, cycles, model)
    count = _spawn(rates, count, before, model, measurement, in_bank)
    if count == 0:
        return 0
    weight = run_length_update.log_sum_exp(rates, 0, count)
    is_announced = measurement.announced > 0.0
    if is_announced:
        for i in range(count):
            _step(rates[i : i + 1], model.step_variance)
    density, _ = run_length_update.update(rates, count, measurement, in_bank.outlier_probability)
    # after a step of unknown size a measurement says nothing of the rate
    gained = 0.0 if is_announced else density - in_bank.log_density
    if measurement.announced == 0.0:
        gained += math.log1p(-min(model.hazard * cycles, 0.5))
    for i in range(count):
        rates[i].log_weight += weight + gained
    return run_length_update.prune(rates, count, measurement.cycle, -np.inf, CAPACITY)


@compiled
def _spawn(
    rates: Bank,
    count: int,
    before: Bank,
    model: BankModel,
    measurement: Measurement,
    in_bank: BankOutcome,
) -> int:
    """Add the hypothesis that another rate begins with this cycle, after any of those in the same batch."""
    split = 0
    while split < len(before) and before[split].change_cycle <= in_bank.since:
        split += 1
    if split + count == 0:
        return 0
    pasts, past = np.empty(2, rates.dtype), 0
    if split:
        run_length_update.merge(before, 0, split, pasts)
        pasts[0].log_weight = run_length_update.weight_by_slopes(before, 0, split, model.slope_prior)
        run_length_update.predict(pasts, 1, measurement.cycles, model)
        past = 1
    if count:
        run_length_update.merge(rates, 0, count, pasts[past:])
        past += 1
    run_length_update.merge(pasts, 0, past, rates[count:])
    begun = rates[count]
    square = begun.mean[SLOPE] ** 2
    prior = square - SEEN**2 * begun.covariance[SLOPE, SLOPE]
    if prior <= 0.0 or square < STEEP**2 * model.slope_prior:
        return count
    is_young = measurement.cycle < in_bank.begun + YOUNG
    hazard = model.hazard * (YOUNG_HAZARD if is_young else RATE_HAZARD)
    begun.log_weight += math.log(min(hazard * measurement.cycles, 0.5))
    begun.change_cycle = measurement.cycle
    begun.mean[SLOPE] = 0.0
    for a in range(STATES):
        begun.covariance[a, SLOPE] = begun.covariance[SLOPE, a] = 0.0
    begun.covariance[SLOPE, SLOPE] = prior
    return count + 1


@compiled
def _step(hypothesis: Bank, variance: float) -> None:
    """Let a batch begin whose step is only known to have this variance; it is the last shift."""
    mean, covariance = hypothesis[0].mean, hypothesis[0].covariance
    mean[SHIFT] = 0.0
    for a in range(STATES):
        covariance[a, SHIFT] = covariance[SHIFT, a] = 0.0
    for a in (TOTAL, OFFSET, SHIFT):
        for b in (TOTAL, OFFSET, SHIFT):
            covariance[a, b] += variance


@compiled
def statistics(
    bank: Bank, rates: Bank, model: BankModel, measurement: Measurement, accepted: float
) -> Statistics:
    """Weigh another batch, another rate and neither against each other, after a measurement.

    Parameters
    ----------
    accepted : float
        Changes of the batch up to this cycle have been reported.
    """
    changed, unchanged = run_length_bank.change_weights(bank, len(bank), model, measurement, accepted)
    rate = run_length_update.log_sum_exp(rates, 0, len(rates))
    same_batch, same_rate = np.logaddexp(unchanged, rate), np.logaddexp(unchanged, changed)
    log_hazard, log_rate_hazard = math.log(model.hazard), math.log(RATE_HAZARD * model.hazard)
    return Statistics(
        changed - same_batch - log_hazard if same_batch > -np.inf else np.inf,
        rate - same_rate - log_rate_hazard if rate > -np.inf else -np.inf,
        changed - rate - log_hazard if rate > -np.inf else np.inf,
    )


@compiled
def replay(
    bank: Bank,
    count: int,
    rates: Bank,
    model: BankModel,
    series: Samples,
    outliers: Samples,
    accepted: float,
) -> tuple[int, int]:
    """Take the rows of a series, shape (n, 6), but for the first, into the bank and into `rates`.

    Parameters
    ----------
    outliers : ndarray, shape (2,)
        As `run_length_bank.take` has it.

    Returns
    -------
    hypotheses, of another rate : int
    """
    found, begun = 0, series[0, CYCLE]
    for row in series[1:]:
        measurement = Measurement(row[0], row[1], row[2], row[3], row[4], row[5])
        before = bank[:count].copy()
        probability = run_length_bank.outlier_probability(model.outlier_probability, outliers[0], outliers[1])
        count, log_density, _ = run_length_bank.take(bank, count, model, measurement, outliers, accepted)
        since = run_length_bank.settled_until(measurement, accepted)
        in_bank = BankOutcome(probability, log_density, since, begun)
        found = take(rates, found, before, model, measurement, in_bank)
    return count, found


def joined(rows: Samples, rates: Samples, cycle: int, accepted: int, slope_prior: float) -> Samples:
    """Make hypotheses of another rate such of the bank, as settled as the last change of batch.

    Their weights add up to one again.
    """
    cycles = run_length_bank.records(rows)["change_cycle"]
    split = int(np.searchsorted(cycles, accepted, side="right"))
    all_rows = np.vstack([rows[:split], rates, rows[split:]])
    bank = run_length_bank.workspace(all_rows, len(all_rows))
    settled = bank[split : split + len(rates)]
    settled["change_cycle"] = accepted
    for hypothesis in settled:
        # the bank weighs its slopes by the same mixture, each time that it is asked
        hypothesis["log_weight"] -= run_length_update.slope_evidence(
            hypothesis["mean"][SLOPE], hypothesis["covariance"][SLOPE, SLOPE], slope_prior
        )
    count = run_length_update.prune(
        bank, len(bank), float(cycle), float(accepted), run_length_update.CAPACITY
    )
    bank["log_weight"][:count] -= run_length_update.log_sum_exp(bank, 0, count)
    return run_length_bank.stored(bank, count)


def has_rate_changed(rows: Samples, rates: Samples, slope_prior: float) -> bool:
    """Whether it is likelier that wear goes on at another rate than all that the bank knows."""
    known, others = run_length_bank.records(rows), run_length_bank.records(rates)
    weight = run_length_update.log_sum_exp(others, 0, len(others))
    return bool(weight > run_length_update.weight_by_slopes(known, 0, len(known), slope_prior))


def mixture(rows: Samples, rates: Samples, slope_prior: float) -> Samples:
    """Put the bank and the hypotheses of another rate together, weighed alike."""
    bank = run_length_bank.workspace(rows, len(rows))
    for hypothesis in bank:
        hypothesis["log_weight"] += run_length_update.slope_evidence(
            hypothesis["mean"][SLOPE], hypothesis["covariance"][SLOPE, SLOPE], slope_prior
        )
    return np.vstack([run_length_bank.stored(bank, len(bank)), rates])
