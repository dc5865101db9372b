"""Shot-level restricted wild bootstrap of many scores at once, and p-values by min-P over families.

Under the fitted model a shot's residual is as likely as its mirror image. Every draw mirrors whole shots at
random and refits the shared parameters to first order; what neighbouring samples have in common, and what
differs from shot to shot, stays as it is. References: Cameron, Gelbach and Miller (2008) for the cluster wild
bootstrap; Kline and Santos (2012) for its score form; Westfall and Young (1993) for min-P.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import f as fisher

from impactcell.discrepancy.data import IndexArray
from impactcell.discrepancy.model import LinearisedFit, Scores
from impactcell.records import Samples

DRAWS = 1999
"""Draws: the smallest p-value is 1/2000, a tenth of the level of a step's half."""
DIRECTIONS_PER_BATCH = 64
"""Directions resampled at once, so that the draws fit into a few megabytes."""


@dataclass(frozen=True, slots=True, eq=False)
class BootstrapTests:
    """Outcome of a family of groups of directions; a group's statistic is the largest of its directions.

    Attributes
    ----------
    statistic : ndarray, shape (groups,)
    p_single : ndarray, shape (groups,)
        p-value of each group by itself.
    p_adjusted : ndarray, shape (groups,)
        p-value that holds over all groups together.
    """

    statistic: Samples
    p_single: Samples
    p_adjusted: Samples


def wild_bootstrap(
    linearisation: LinearisedFit,
    scores: Scores,
    groups: IndexArray,
    seed: tuple[int, ...],
    one_sided: Samples | None = None,
    least: Samples | None = None,
    draws: int = DRAWS,
) -> BootstrapTests:
    """Test groups of directions.

    Parameters
    ----------
    groups : ndarray, shape (Q,)
        Group of each direction, 0 to groups - 1.
    one_sided : ndarray, shape (Q,), optional
        +1 or -1 where only an amplitude of that sign makes sense, else 0.
    least : ndarray, shape (Q,), optional
        Least variance of a direction's score, where shots may be alike by more than chance.
    """
    n, Q = scores.each.shape
    count = int(groups.max()) + 1 if Q else 0
    rng = np.random.default_rng(list(seed))
    W = rng.integers(0, 2, size=(draws, n)) * 2.0 - 1.0
    inverse = np.linalg.pinv(linearisation.information, rcond=1e-13, hermitian=True)
    shifts = W @ linearisation.shot_gradient @ inverse
    shift_products = np.einsum("da,db->dab", shifts, shifts).reshape(draws, -1)
    sides = np.zeros(Q) if one_sided is None else one_sided
    smallest = np.zeros(Q) if least is None else least
    statistics = np.zeros((draws + 1, count), order="F")
    for first in range(0, Q, DIRECTIONS_PER_BATCH):
        part = slice(first, min(first + DIRECTIONS_PER_BATCH, Q))
        e, K = scores.each[:, part], scores.leverage[:, part]
        U = np.vstack([e.sum(0), W @ e])
        V = np.broadcast_to((e**2).sum(0), U.shape).copy()
        for a in range(K.shape[2]):
            V[1:] -= 2.0 * shifts[:, a : a + 1] * (W @ (e * K[:, :, a]))
        of_shots = K.swapaxes(0, 1)
        V[1:] += shift_products @ (of_shots.swapaxes(1, 2) @ of_shots).reshape(e.shape[1], -1).T
        V = np.maximum(V, smallest[part])
        safe = np.where(V > 1e-300, V, 1.0)
        T = np.where(V > 1e-300, U**2 / safe, 0.0)
        side = sides[part]
        T = np.where((side != 0.0) & (U * side < 0.0), 0.0, T)
        for column, group in enumerate(groups[part]):
            statistics[:, group] = np.maximum(statistics[:, group], T[:, column])
    return _min_p(statistics, np.bincount(groups, minlength=count), n)


def _min_p(statistics: Samples, size: IndexArray, shots: int) -> BootstrapTests:
    """p-values from statistics of shape (draws + 1, groups), the observed ones first.

    Groups are made comparable by what a statistic would mean for as many independent directions as the group
    has and normal scores: that is only a scale, on which the draws say how small the smallest may be. Unlike
    ranks within each group it does not run out of digits.
    """
    total = len(statistics)
    if not statistics.shape[1]:
        return BootstrapTests(np.empty(0), np.empty(0), np.empty(0))
    ordered = np.sort(statistics, axis=0)
    below = [
        np.searchsorted(ordered[:, g], statistics[0, g], side="left") for g in range(statistics.shape[1])
    ]
    single = (total - np.array(below)) / total
    ratio = statistics * (shots - 1) / np.maximum(shots - statistics, 1e-9)
    scale = fisher.logsf(ratio, 1, shots - 1) + np.log(np.maximum(size, 1))
    smallest = np.sort(scale.min(axis=1))
    adjusted = np.searchsorted(smallest, scale[0] + 1e-9, side="right") / total
    return BootstrapTests(statistics[0], single, np.maximum(adjusted, single))
