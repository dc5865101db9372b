"""How cycles of one material differ from its mean: a covariance in few modes, learned without bias.

A cycle deviates from the mean m of its material by B a, a ~ N(0, Lambda), B the lowest cosines along the
grid. From a cycle with information G is seen d = B' (h - G m) sqrt(w / (w + 1)), m resting on w cycles: its
covariance is K Lambda K + K, K = B' G B. With T = (I + K)^-1, W = T K, in units of the first guess of a,
the equations::

    sum over cycles of  T d d' T - T K T' - W Lambda W = 0

are linear in Lambda and right in the mean (C. R. Rao 1971, J. Multivariate Analysis 1:257, with the first
guess as weights), so that two sums are all that is kept, and slides may end in different places. Eigenvalues
that noise alone could have made, in units of the noise, are zero: else the modes swallow what they should
tell apart. What no slide has reached keeps the first guess.
"""

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from impactcell.compiled import compiled
from impactcell.records import Samples
from impactcell.tracking import linear

MODES = 6
PAIRS = MODES * (MODES + 1) // 2
UPPER = np.triu_indices(MODES)
FIRST_SPREAD = 0.05  # of the friction itself: how much cycles vary before anything is known
RIDGE = 0.5  # cycles' worth of weight on no variation at all, where nothing was seen


@dataclass(frozen=True, slots=True, eq=False)
class Variation:
    """Sums over cycles, in units of the first guess `scale` of each mode.

    Attributes
    ----------
    cycles : int
        Cycles learned from.
    scale : ndarray, shape (6,)
        First guess of the modes' standard deviations, friction.
    weights : ndarray, shape (21, 21)
        Sum of tr(E_p W E_q W), E_p the symmetric unit matrices.
    moments : ndarray, shape (21,)
        Sum of tr E_p (T d d' T - T K T').
    information : ndarray, shape (6, 6)
        Sum of K.
    spread : ndarray, shape (6, 6)
        Lambda.
    """

    cycles: int = 0
    scale: Samples = field(default_factory=lambda: np.zeros(MODES))
    weights: Samples = field(default_factory=lambda: np.zeros((PAIRS, PAIRS)))
    moments: Samples = field(default_factory=lambda: np.zeros(PAIRS))
    information: Samples = field(default_factory=lambda: np.zeros((MODES, MODES)))
    spread: Samples = field(default_factory=lambda: np.eye(MODES))


def guess(friction: float) -> Variation:
    """Before the first cycle, from the friction's own size."""
    scale = FIRST_SPREAD * abs(friction) / np.arange(1.0, MODES + 1.0)
    weights, moments = np.zeros((PAIRS, PAIRS)), np.zeros(PAIRS)
    _add(np.eye(MODES), np.zeros((MODES, MODES)), RIDGE, weights, moments)
    return Variation(scale=scale, weights=weights, moments=moments)


def learn(variation: Variation, matrix: Samples, vector: Samples, weight: float) -> Variation:
    """Take one cycle in.

    Parameters
    ----------
    matrix : ndarray, shape (j, j)
        Information G of the cycle.
    vector : ndarray, shape (j,)
        h - G m.
    weight : float
        Cycles that m rests on.
    """
    basis = cosines(len(vector)) * variation.scale
    weights, moments = variation.weights.copy(), variation.moments.copy()
    K = basis.T @ matrix @ basis
    K = (K + K.T) / 2.0
    T = np.linalg.inv(np.eye(MODES) + K)
    r = T @ (basis.T @ vector) * math.sqrt(weight / (weight + 1.0))
    W = T @ K
    W = (W + W.T) / 2.0
    _add(W, np.outer(r, r) - W @ T.T, 1.0, weights, moments)
    information, cycles = variation.information + K, variation.cycles + 1
    spread = _solved(weights, moments, information, cycles)
    return Variation(cycles, variation.scale, weights, moments, information, spread)


def _solved(weights: Samples, moments: Samples, information: Samples, cycles: int) -> Samples:
    found = np.empty((MODES, MODES))
    found[UPPER] = linear.solved(weights, moments)
    found.T[UPPER] = found[UPPER]
    # in units of the noise of one cycle
    root = np.linalg.cholesky(information / cycles + np.eye(MODES))
    values, vectors = linear.eigen(root.T @ found @ root)
    # what noise alone makes of six zeros at most (Marchenko & Pastur 1967) says nothing
    edge = (1.0 + math.sqrt(MODES / cycles)) ** 2 - 1.0
    back = np.linalg.solve(root.T, vectors * np.sqrt(np.where(values > edge, values, 0.0)))
    return np.asarray(back @ back.T + np.linalg.inv(information + np.eye(MODES)))


def components(variation: Variation, coefficients: int) -> Samples:
    """Principal components as columns, largest first, scaled to their standard deviations, shape (j, 6)."""
    values, vectors = linear.eigen(variation.spread)
    scaled = vectors[:, ::-1] * np.sqrt(np.maximum(values[::-1], 0.0))
    return np.asarray((cosines(coefficients) * variation.scale) @ scaled)


@lru_cache(maxsize=8)
def cosines(coefficients: int) -> Samples:
    """Lowest cosines along the grid, of unit mean square, shape (j, 6)."""
    place = (np.arange(coefficients) + 0.5) / coefficients
    modes = np.cos(math.pi * np.outer(place, np.arange(MODES)))
    unit: Samples = modes / np.sqrt((modes**2).mean(axis=0))
    return unit


@compiled
def _add(W: Samples, seen: Samples, share: float, weights: Samples, moments: Samples) -> None:
    """Add tr(E_p W E_q W) and tr(E_p seen) to the sums."""
    n = len(W)
    p = 0
    for i in range(n):
        for j in range(i, n):
            twice = 1.0 if i == j else 2.0
            moments[p] += share * twice * seen[i, j]
            q = 0
            for k in range(n):
                for m in range(k, n):
                    both = 0.5 if k == m else 1.0
                    weights[p, q] += share * twice * both * (W[i, k] * W[j, m] + W[i, m] * W[j, k])
                    q += 1
            p += 1
