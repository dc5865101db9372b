"""Does the model still explain the captures? A self-starting CUSUM on each capture's normalised residual.

Hawkins (1987, The Statistician 36:299): the residual of capture n, standardised by mean and standard
deviation of those before, is turned into an exactly standard normal score by Student's t distribution,
so that the false-alarm rate holds from the first captures on, whatever level is usual for the cell. Scores
that are correlated from capture to capture are divided by the root of what that makes of a sum's variance.
"""

import functools
import math
from dataclasses import dataclass, field

from scipy.special import ndtri, stdtr

from impactcell.numerics import scatter_correlation
from impactcell.numerics.scatter_correlation import Variogram
from impactcell.records import Evidence

SLACK = 0.75
"""Half of the shift that is found fastest, in standard deviations (k of the CUSUM)."""
LEARNED = 500
"""Captures from which the usual residual is learned."""
FIRST = 10
"""Captures before anything is said."""
LARGEST_SCORE = 4.0
"""A single capture counts at most so many standard deviations."""
CAP = 2.0
"""The excess stops at so many thresholds, so that a gap that is closed is seen to be closed within a few
captures."""
SIEGMUND = 1.166
"""Siegmund's correction of the threshold for the overshoot of normal scores, in standard deviations (1985,
Sequential Analysis, ch. 10: 2 x 0.583)."""
SECONDS_A_DAY = 86_400.0
"""Seconds."""


@dataclass(frozen=True, slots=True)
class GapState:
    """Usual logarithm of the residual, and the cumulated excess over it.

    Attributes
    ----------
    count : int
        Captures that mean and squared_deviations are learned from.
    mean, squared_deviations : float
        Mean of the logarithms, and the sum of their squared deviations from it (Welford).
    excess : float
        Detection statistic of the CUSUM.
    since : int
        Cycle at which the excess last left zero.
    variogram : Variogram
        Of the scores.
    """

    count: int = 0
    mean: float = 0.0
    squared_deviations: float = 0.0
    excess: float = 0.0
    since: int = 0
    variogram: Variogram = field(default_factory=Variogram)


@dataclass(frozen=True, slots=True)
class GapResult:
    """Outcome of one capture; `exceeds` None while the usual residual is being learned, or there is none.

    Then the evidence has the threshold alone.
    """

    state: GapState
    exceeds: bool | None
    evidence: Evidence
    reason: str = ""


def update(state: GapState, gap: float, cycle: int, false_alarm_cycles: float, period_s: float) -> GapResult:
    """Take one capture's normalised residual (1 = noise floor) into the state.

    Parameters
    ----------
    false_alarm_cycles : float
        Designed mean number of captures between false alarms.
    period_s : float
        Time between them.
    """
    limit = threshold(false_alarm_cycles)
    if not (math.isfinite(gap) and gap > 0.0):
        return GapResult(state, None, Evidence(threshold=limit), "the capture has no normalised residual")
    value = math.log(gap)
    score = _score(state, value)
    variogram = scatter_correlation.update(state.variogram, score, 1.0)
    inflation = scatter_correlation.variance_over_scatter(variogram.correlation)
    excess = min(max(0.0, state.excess + score / math.sqrt(inflation) - SLACK), CAP * limit)
    since = cycle if state.excess == 0.0 else state.since
    count, mean, squared_deviations = state.count, state.mean, state.squared_deviations
    if count < LEARNED and state.excess <= limit:
        count += 1
        step = value - mean
        mean += step / count
        squared_deviations += step * (value - mean)
    updated = GapState(count, mean, squared_deviations, excess, since, variogram)
    if count < FIRST:
        return GapResult(updated, None, Evidence(threshold=limit), "the usual residual is being learned")
    usual = math.exp(mean)
    evidence = Evidence(
        excess,
        limit,
        since if excess > 0.0 else 0,
        gap - usual,
        usual * math.sqrt(squared_deviations / max(count - 1, 1)),
        false_alarm_cycles,
        false_alarm_cycles * period_s / SECONDS_A_DAY,
    )
    return GapResult(updated, excess > limit, evidence)


@functools.cache
def threshold(false_alarm_cycles: float) -> float:
    """Threshold of a one-sided CUSUM of standard normal scores for a mean time between false alarms.

    Siegmund (1985): ARL = (exp(2 k b) - 2 k b - 1) / (2 k^2), b = h + 1.166; solved by Newton's method.
    """
    b = math.log(2.0 * SLACK**2 * false_alarm_cycles + 10.0) / (2.0 * SLACK) + 1.0
    for _ in range(100):
        value = math.exp(2.0 * SLACK * b) - 2.0 * SLACK * b - 1.0 - 2.0 * SLACK**2 * false_alarm_cycles
        step = value / (2.0 * SLACK * (math.exp(2.0 * SLACK * b) - 1.0))
        b -= step
        if abs(step) < 1e-12 * b:
            break
    return b - SIEGMUND


def _score(state: GapState, value: float) -> float:
    """Give the standard normal score of a logarithm after those before, by the small tail for its digits."""
    n = state.count
    if n < 2 or state.squared_deviations <= 0.0:
        return 0.0
    t = math.sqrt(n / (n + 1.0)) * (value - state.mean) / math.sqrt(state.squared_deviations / (n - 1))
    tail = float(stdtr(n - 1, -abs(t)))
    score = LARGEST_SCORE if tail <= 0.0 else min(float(-ndtri(tail)), LARGEST_SCORE)
    return math.copysign(score, t)
