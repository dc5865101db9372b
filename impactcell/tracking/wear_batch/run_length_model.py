"""What the run-length bank is made of: one hypothesis, what all of them assume, and what a cycle brings."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

STATES = 4
"""Quantities that a hypothesis estimates."""
TOTAL, SLOPE, OFFSET, SHIFT = range(STATES)
"""Their places in mean and covariance: friction of the present batch, its wear a cycle, its offset from the
first batch, and the last shift (this offset minus the one before); mu_s, mu_s a cycle, mu_s, mu_s."""
HYPOTHESIS = np.dtype(
    [
        ("log_weight", np.float64),
        ("change_cycle", np.float64),
        ("mean", np.float64, (STATES,)),
        ("covariance", np.float64, (STATES, STATES)),
    ]
)
"""One hypothesis of when the batch last changed: 22 numbers, stored as one row of an array of floats."""
Bank = NDArray[np.void]
"""Array of `HYPOTHESIS`, shape (k,)."""

OUTLIER_SCALE = 10.0
"""Standard deviation of an outlier, in those of a good measurement: that of the contaminated normal."""
STEPS = (
    (0.6, 0.25, 0.25),
    (-0.6, 0.25, 0.25),
    (0.12, 0.035, 0.22),
    (-0.12, 0.035, 0.22),
    (0.0, 3.61, 0.06),
)
"""Prior of a batch step, a mixture: mean, standard deviation and probability of a step up, down, a small one
up, down, and a large one either way, in units of the whole mixture's standard deviation."""
SLOPES = (1.0, 0.3, 0.03, 0.003)
"""Scales on which wear may go on, all as likely, in units of the slope's prior standard deviation: one normal
prior wide enough for the fastest would let a small step pass for wear until there have been many cycles."""


class BankModel(NamedTuple):
    """What the hypotheses assume; all floats, variances in those of mu_s.

    Attributes
    ----------
    hazard : float
        Prior probability of an unannounced change, a cycle.
    step_variance : float
        Of the prior of a batch step.
    level_variance, slope_variance : float
        Of the random walks of level and slope, a cycle.
    outlier_probability : float
        Prior probability that a measurement is an outlier.
    slope_prior : float
        Prior variance of the slope.
    """

    hazard: float
    step_variance: float
    level_variance: float
    slope_variance: float
    outlier_probability: float
    slope_prior: float


class BankMoments(NamedTuple):
    """Means, variances and covariances of total, slope and offset over all hypotheses."""

    total: float
    slope: float
    offset: float
    total_variance: float
    total_slope: float
    total_offset: float
    slope_variance: float
    slope_offset: float
    offset_variance: float


class Measurement(NamedTuple):
    """What one cycle brings to the bank; all floats.

    Attributes
    ----------
    value, variance : float
        mu_s and the variance of its error.
    cycles : float
        Cycles passed since the newest one; 0 for one that comes late.
    lag : float
        By how many cycles it comes late.
    cycle : float
        Its own cycle.
    announced : float
        1: a batch change came just before it; -1: surely none; 0: nobody says.
    """

    value: float
    variance: float
    cycles: float
    lag: float
    cycle: float
    announced: float
