"""How cycles of one material differ from its mean: a covariance in few modes, learned without bias.

A cycle deviates from the mean m of its material by B a, a ~ N(0, Lambda), B the lowest cosines along the
grid. From a cycle with information G is seen d = B' (h - G m) sqrt(w / (w + 1)), m resting on w cycles: its
covariance is K Lambda K + K, K = B' G B. With T = (I + K)^-1, W = T K, in units of the first guess of a,
the equations::

    sum over cycles of  T d d' T - T K T' - W Lambda W = 0

are linear in Lambda and right in the mean (C. R. Rao 1971, J. Multivariate Analysis 1:257, with the first
guess as weights), so that two sums are all that is kept, and slides may end in different places. Eigenvalues
that noise alone could have made, in units of the noise, are zero: else the modes swallow what they should
tell apart. Added is what the cycles could not have seen, the standard error of a variation of none; where no
slide has reached that is the first guess.
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


def learn(
    variation: Variation, matrix: Samples, vector: Samples, weight: float, coefficients: int
) -> Variation:
    """Take one cycle in.

    Parameters
    ----------
    matrix : ndarray, shape (s, s)
        Information G of the cycle on the first s coefficients.
    vector : ndarray, shape (s,)
        h - G m.
    weight : float
        Cycles that m rests on.
    coefficients : int
        All of them, j.
    """
    sums = _taken(
        basis(variation, coefficients)[: len(vector)].copy(),
        matrix,
        vector,
        weight / (weight + 1.0),
        variation.weights,
        variation.moments,
        variation.information,
        variation.cycles + 1,
    )
    return Variation(variation.cycles + 1, variation.scale, *sums)


def basis(variation: Variation, coefficients: int) -> Samples:
    """Modes in units of their first guess, as columns, shape (j, 6)."""
    return cosines(coefficients) * variation.scale


@compiled
def _taken(
    B: Samples,
    matrix: Samples,
    vector: Samples,
    share: float,
    weights: Samples,
    moments: Samples,
    information: Samples,
    cycles: int,
) -> tuple[Samples, Samples, Samples, Samples]:
    """All sums with one cycle more, and Lambda."""
    K = B.T @ (matrix @ B)
    K = (K + K.T) / 2.0
    T = np.linalg.inv(np.eye(MODES) + K)
    r = T @ (B.T @ vector)
    W = T @ K
    W = (W + W.T) / 2.0
    weights, moments, information = weights.copy(), moments.copy(), information + K
    _add(W, share * np.outer(r, r) - W @ T.T, 1.0, weights, moments)
    return weights, moments, information, _spread(weights, moments, information, cycles)


@compiled
def _spread(weights: Samples, moments: Samples, information: Samples, cycles: int) -> Samples:
    found, upper, p = np.empty((MODES, MODES)), linear.solved(weights, moments), 0
    for i in range(MODES):
        for j in range(i, MODES):
            found[i, j] = found[j, i] = upper[p]
            p += 1
    # in units of the noise of one cycle
    root = linear.factor((information + np.eye(MODES)) / cycles)
    values, vectors = np.linalg.eigh(root.T @ found @ root)
    # what noise alone makes of six zeros at most (Marchenko & Pastur 1967) says nothing
    edge = (1.0 + math.sqrt(MODES / cycles)) ** 2 - 1.0
    back = linear.backward(root, vectors * np.sqrt(np.where(values > edge, values, 0.0)))
    # noise in n cycles hides a variance of sqrt(2 / n) of its own
    spread: Samples = back @ back.T + np.linalg.inv(information / math.sqrt(2.0 * cycles) + np.eye(MODES))
    return spread


def components(variation: Variation, coefficients: int) -> Samples:
    """Principal components as columns, largest first, scaled to their standard deviations, shape (j, 6)."""
    return _scaled(variation.spread, basis(variation, coefficients))


@compiled
def _scaled(spread: Samples, B: Samples) -> Samples:
    values, vectors = np.linalg.eigh(spread)
    scaled = vectors * np.sqrt(np.maximum(values, 0.0))
    largest_first: Samples = B @ scaled[:, ::-1].copy()
    return largest_first


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
