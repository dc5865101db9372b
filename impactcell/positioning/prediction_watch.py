"""Whether the planner's predictions are calibrated, watched tap by tap.

The probability integral transform u = F(moved) of a calibrated forecast is uniform, and s = Phi^-1(u)
standard normal, whatever was forecast. Bets against that are placed on shifts and on spreads,
e = p_i(s) / p_0(s); each has expectation 1 while predictions are calibrated, so that the Shiryaev-Roberts sum

    R <- (R + 1) e,   mean over the bets,

exceeds a threshold no more often than once in that many taps, whenever one looks (e-detector: Shin, Ramdas
and Rinaldo, 2023).

A single tap may be far off because somebody has moved the part. That is reason enough to be cautious, and
doubts count all of a bet; what is told counts no more of it than a bound, so that it takes several taps. A
bounded bet min(e, c) is nowhere above e, so that its expectation is 1 at most as well, and what is said of
false alarms holds for it too.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtr, ndtri

from impactcell.records import Samples

BETS = np.array([[1.0, 1.0], [-1.0, 1.0], [2.0, 1.5], [-2.0, 1.5], [0.0, 1.6], [0.0, 2.5], [0.0, 4.0]])
"""Mean and standard deviation of s under each bet."""
NOTHING_BET = np.full(len(BETS), -math.inf)
"""ln R before the first tap."""
FURTHEST = 8.0
"""Standard deviations beyond which a score says no more."""
POSITION_NOISE_M = 0.5e-6
"""Standard deviation of a displacement by an encoder with steps of 1 µm: half a step, which is a little more
than that of the difference of two readings, each rounded."""
ATOM_M = 1e-9
"""Nearer than that, displacements are one: all taps that move nothing."""
DOUBT = 200.0
"""Mean taps between two false doubts, at which taps become cautious."""
CONFIDENT_AGAIN = 20.0
"""Below it a doubt is over."""
ALARM = 1e5
"""Mean taps between two false alarms: as seldom as those of the tracker."""
MOST_OF_A_BET = math.log(100.0)
"""ln of what a bet may win with one tap where it is told: usually the third tap in a row is the first that
alarms, and as good as never the first."""


@dataclass(frozen=True, slots=True, eq=False)
class PredictionWatch:
    """What has been bet and won.

    Attributes
    ----------
    log_sums : ndarray, shape (bets,)
        ln R of each bet.
    score : float
        s of the last tap.
    doubted : bool
        Predictions are off, and taps are cautious.
    told_log_sums : ndarray, shape (bets,)
        ln R of each bet, no tap winning more than `MOST_OF_A_BET`.
    off_taps : int
        Taps since these began to rise, the last one included; 0 where they have not.
    off_score : float
        Sum of s over these taps.
    """

    log_sums: Samples = field(default_factory=NOTHING_BET.copy)
    score: float = 0.0
    doubted: bool = False
    told_log_sums: Samples = field(default_factory=NOTHING_BET.copy)
    off_taps: int = 0
    off_score: float = 0.0

    @property
    def evidence(self) -> float:
        """Mean R over the bets."""
        return _mean_of(self.log_sums)

    @property
    def told_evidence(self) -> float:
        """Mean R over the bets, no tap winning more than `MOST_OF_A_BET`."""
        return _mean_of(self.told_log_sums)

    @property
    def alarming(self) -> bool:
        """Predictions are off beyond what chance does, and not by one tap alone."""
        return self.told_evidence >= ALARM

    @property
    def mean_score(self) -> float:
        """Mean s of the taps at which predictions have been off."""
        return self.off_score / max(self.off_taps, 1)


def _mean_of(log_sums: Samples) -> float:
    return float(np.exp(np.minimum(log_sums, 700.0)).mean())


def as_measured(quantiles: Samples, z: Samples, noise_m: float) -> Samples:
    """Displacements at the nodes z as a sensor with this standard deviation (m) shows them.

    `POSITION_NOISE_M` of it is left out: so little hardly widens what is foretold of a tap.
    """
    variance = noise_m**2 - POSITION_NOISE_M**2
    if variance <= 0.0:
        return quantiles
    centre = quantiles[z.size // 2]
    off = quantiles - centre
    towards = np.where(off == 0.0, -np.sign(z), np.sign(off))  # less friction, further
    measured: Samples = centre + towards * np.sqrt(off**2 + variance * z**2)
    return measured


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
    told = np.logaddexp(before.told_log_sums, 0.0) + np.minimum(log_bet, MOST_OF_A_BET)
    doubted = _mean_of(sums) >= (CONFIDENT_AGAIN if before.doubted else DOUBT)
    if _mean_of(told) < CONFIDENT_AGAIN:
        return PredictionWatch(sums, score, doubted, told)
    return PredictionWatch(sums, score, doubted, told, before.off_taps + 1, before.off_score + score)
