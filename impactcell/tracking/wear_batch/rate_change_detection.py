"""When another wear rate is certain enough to be believed, and what goes on from there."""

import math
from dataclasses import replace

import numpy as np

from impactcell.tracking.wear_batch import (
    batch_change_detection,
    batch_filter,
    noise_scale,
    rate_changes,
    run_length_bank,
)
from impactcell.tracking.wear_batch.batch_filter import BankUpdate
from impactcell.tracking.wear_batch.input_validation import CycleClock
from impactcell.tracking.wear_batch.run_length_model import SLOPE
from impactcell.tracking.wear_batch.settings import TrackerSettings
from impactcell.tracking.wear_batch.state import RateChange, TrackerState, UsableCycle
from impactcell.tracking.wear_batch.wear_report import INTERVAL_STDS

STEEPEST = 1.0
"""Rate a cycle, in standard deviations of a usual estimate, beyond which none is told: the scatter, learned
from differences, is then that of wear itself, as where values have none, and shows no change of it."""


def detect_rate_change(
    settings: TrackerSettings, state: TrackerState, cycle: UsableCycle, updated: BankUpdate, clock: CycleClock
) -> tuple[TrackerState, BankUpdate, list[str]]:
    """Believe that wear goes on at another rate once a cycle, in the bank by now, makes it certain enough.

    Its hypotheses go on in the bank, as such of the same batch. What the cycles before said of wear, and made
    of other walks, is given up; the walk that is believed stays. Also says what is believed now.

    Parameters
    ----------
    clock : CycleClock
        With this cycle in it.
    """
    threshold = run_length_bank.threshold(settings.false_alarm_cycles)
    is_quiet = cycle.announced > 0.0 or cycle.timing.lag > 0
    if is_quiet or not batch_change_detection.is_certain(
        state, cycle.noise, updated.rate_statistic, threshold
    ):
        return state, updated, []
    index = cycle.timing.index
    rates = run_length_bank.records(updated.rates)
    likeliest = rates[int(np.argmax(rates["log_weight"]))]
    before = float(run_length_bank.moments(updated.bank)[0][SLOPE])
    after, std = float(likeliest["mean"][SLOPE]), math.sqrt(likeliest["covariance"][SLOPE, SLOPE])
    if abs(after) > STEEPEST * math.sqrt(noise_scale.usual_variance(cycle.noise)):
        return state, updated, []
    change = RateChange(int(likeliest["change_cycle"]), before, after, std, index)
    interval = f"{1000.0 * after:.3g} ± {1000.0 * INTERVAL_STDS * std:.2g}"
    note = (
        f"since cycle {clock.number(change.cycle)} mu_s goes by {interval} in 1000 cycles, "
        f"{1000.0 * before:.3g} before"
    )
    state = replace(state, rate_change=change, wear_blocks=None, walk_models=None, commissioning=None)
    slope_prior = batch_filter.bank_model(settings, state, cycle).slope_prior
    bank = rate_changes.joined(updated.bank, updated.rates, index, state.accepted, slope_prior)
    return state, replace(updated, bank=bank, rates=run_length_bank.EMPTY, statistic=-math.inf), [note]
