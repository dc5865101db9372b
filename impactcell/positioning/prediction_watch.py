"""Whether the planner's predictions are calibrated, watched tap by tap.

The probability integral transform u = F(moved) of a calibrated forecast is uniform, and s = Phi^-1(u)
standard normal, whatever was forecast. Bets against that are placed on shifts and on spreads,
e = p_i(s) / p_0(s); each has expectation 1 while predictions are calibrated, so that the Shiryaev-Roberts sum

    R <- (R + 1) e,   mean over the bets,

exceeds a threshold no more often than once in that many taps, whenever one looks (e-detector: Shin, Ramdas
and Rinaldo, 2023).
"""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtr, ndtri

from impactcell.records import Samples

BETS = np.array([[1.0, 1.0], [-1.0, 1.0], [2.0, 1.5], [-2.0, 1.5], [0.0, 1.6], [0.0, 2.5], [0.0, 4.0]])
"""Mean and standard deviation of s under each bet."""
FURTHEST = 8.0
"""Standard deviations beyond which a score says no more."""
ATOM_M = 1e-9
"""Nearer than that, displacements are one: all taps that move nothing."""
DOUBT = 200.0
"""Mean taps between two false doubts, at which taps become cautious."""
CONFIDENT_AGAIN = 20.0
"""Below it a doubt is over."""
ALARM = 1e5
"""Mean taps between two false alarms: as seldom as those of the tracker."""


@dataclass(frozen=True, slots=True, eq=False)
class PredictionWatch:
    """What has been bet and won.

    Attributes
    ----------
    log_sums : ndarray, shape (bets,)
        ln R of each bet; -inf before the first tap.
    score : float
        s of the last tap.
    doubted : bool
        Predictions are off, and taps are cautious.
    """

    log_sums: Samples = field(default_factory=lambda: np.full(len(BETS), -math.inf))
    score: float = 0.0
    doubted: bool = False

    @property
    def evidence(self) -> float:
        """Mean R over the bets."""
        return float(np.exp(np.minimum(self.log_sums, 700.0)).mean())

    @property
    def alarming(self) -> bool:
        """Predictions are off beyond what chance does."""
        return self.evidence >= ALARM


def score_of(moved_m: float, quantiles: Samples, z: Samples) -> float:
    """Score s of a displacement, given the displacements at the nodes z in standard deviations."""
    low, high = np.minimum(quantiles[:-1], quantiles[1:]), np.maximum(quantiles[:-1], quantiles[1:])
    below = np.clip((moved_m - low) / np.maximum(high - low, 1e-15), 0.0, 1.0)
    below[(high - low < ATOM_M) & (np.abs(moved_m - low) < ATOM_M)] = 0.5  # of taps that move nothing
    probability = np.diff(ndtr(z))
    total = float(probability @ below) / float(probability.sum())
    if 0.0 < total < 1.0:
        return float(np.clip(ndtri(total), -FURTHEST, FURTHEST))
    # beyond the outermost nodes: on in units of the last standard deviation
    centre = quantiles[z.size // 2]
    edge = quantiles.max() if total >= 1.0 else quantiles.min()
    return float(np.clip((moved_m - centre) / max(abs(edge - centre), 1e-9) * z[-1], -FURTHEST, FURTHEST))


def place_bets(before: PredictionWatch, score: float) -> PredictionWatch:
    """Place the bets on one more score."""
    shift, spread = BETS.T
    log_bet = 0.5 * score**2 - 0.5 * ((score - shift) / spread) ** 2 - np.log(spread)
    sums = np.logaddexp(before.log_sums, 0.0) + log_bet
    after = PredictionWatch(sums, score, before.doubted)
    doubted = after.evidence >= (CONFIDENT_AGAIN if before.doubted else DOUBT)
    return PredictionWatch(sums, score, doubted)
