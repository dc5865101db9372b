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

That error is of cycles which count alike and may know the modes very differently, as after taps of different
velocities. Where W and T of all of them commute it is sqrt(2) (sum T^2 W^2)^(1/2) / sum W^2; its inverse is
taken as (A V^-1 A)^(1/2) / sqrt(2), A = sum W^2, V = sum (T W)^2, which for cycles that all know alike is
sqrt(n / 2) K.
"""

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from impactcell.numerics import small_linalg
from impactcell.numerics.jit import compiled
from impactcell.records import Samples

MODES = 6
"""Cosines along the grid by which cycles vary: waves of 1.6 mm and longer on a grid of 4 mm. Our choice."""
PAIRS = MODES * (MODES + 1) // 2
"""Entries of a symmetric matrix of the modes."""
INITIAL_RELATIVE_STD = 0.05
"""How much cycles vary before anything is known, of the friction itself. Our choice."""
RIDGE_CYCLES = 0.5
"""Cycles' worth of weight on no variation at all, where nothing was seen. Our choice."""


class Sums(NamedTuple):
    """The sums of a `Variation`, in compiled code."""

    weights: Samples
    moments: Samples
    signal: Samples
    noise: Samples


@dataclass(frozen=True, slots=True, eq=False)
class Variation:
    """Sums over cycles, in units of the first guess `scale` of each mode.

    Attributes
    ----------
    cycles : int
        Cycles learned from.
    scale : ndarray, shape (6,)
        First guess of the modes' standard deviations, friction.
    weights : ndarray, shape (231,)
        Sum of tr(E_p W E_q W), E_p the symmetric unit matrices: the lower triangle by rows.
    moments : ndarray, shape (21,)
        Sum of tr E_p (T d d' T - T K T').
    signal, noise : ndarray, shape (6, 6)
        Sums of W^2 and of (T W)' T W.
    """

    cycles: int = 0
    scale: Samples = field(default_factory=lambda: np.zeros(MODES))
    weights: Samples = field(default_factory=lambda: np.zeros(PAIRS * (PAIRS + 1) // 2))
    moments: Samples = field(default_factory=lambda: np.zeros(PAIRS))
    signal: Samples = field(default_factory=lambda: np.zeros((MODES, MODES)))
    noise: Samples = field(default_factory=lambda: np.zeros((MODES, MODES)))

    @property
    def sums(self) -> "SumsFields":
        """What a `Sums` is made of."""
        return self.weights, self.moments, self.signal, self.noise


SumsFields = tuple[Samples, Samples, Samples, Samples]
"""Fields of a `Sums`."""


def initial_guess(friction: float) -> Variation:
    """Before the first cycle, from the friction's own size."""
    scale = INITIAL_RELATIVE_STD * abs(friction) / np.arange(1.0, MODES + 1.0)
    variation = Variation(scale=scale)
    _add_to_sums(np.eye(MODES), np.zeros((MODES, MODES)), RIDGE_CYCLES, variation.weights, variation.moments)
    return variation


@compiled
def update_sums(B: Samples, matrix: Samples, vector: Samples, weight: float, sums: Sums) -> Sums:
    """Take one cycle into the four sums.

    Parameters
    ----------
    B : ndarray, shape (s, 6)
        Modes in units of their first guess, on the first s coefficients.
    matrix, vector : ndarray, shapes (s, s), (s,)
        Information G of the cycle on them, and h - G m.
    weight : float
        Cycles that m rests on.
    sums : Sums
        Of the cycles before.
    """
    B = small_linalg.block(B, 0, len(vector), 0, MODES)
    K = small_linalg.transposed_product(small_linalg.transposed_product(matrix, B), B)
    scores = np.zeros((MODES, 1))
    for i in range(len(vector)):
        for k in range(MODES):
            scores[k, 0] += B[i, k] * vector[i]
    inverse_T = K.copy()
    for i in range(MODES):
        inverse_T[i, i] += 1.0
    T = small_linalg.inverse(inverse_T)
    r, W, TKT = (
        small_linalg.transposed_product(T, scores),
        small_linalg.transposed_product(T, K),
        small_linalg.transposed_product(T, small_linalg.transposed_product(K, T)),
    )
    share = weight / (weight + 1.0)
    weights, moments = sums.weights.copy(), sums.moments.copy()
    for i in range(MODES):
        for k in range(MODES):
            W[i, k] = W[k, i] = (W[i, k] + W[k, i]) / 2.0
            TKT[i, k] = share * r[i, 0] * r[k, 0] - TKT[i, k]
    TW = small_linalg.transposed_product(T, W)
    _add_to_sums(W, TKT, 1.0, weights, moments)
    signal = sums.signal + small_linalg.transposed_product(W, W)
    return Sums(weights, moments, signal, sums.noise + small_linalg.transposed_product(TW, TW))


@compiled
def covariance(sums: Sums, cycles: float) -> Samples:
    """Lambda, shape (6, 6)."""
    unbiased, p = np.empty((MODES, MODES)), 0
    upper = small_linalg.solve(small_linalg.unpack_triangle(sums.weights), sums.moments)
    for i in range(MODES):
        for j in range(i, MODES):
            unbiased[i, j] = unbiased[j, i] = upper[p]
            p += 1
    half = small_linalg.solve_lower(small_linalg.cholesky(sums.noise), sums.signal)
    squares, turned = np.linalg.eigh(small_linalg.transposed_product(half, half))
    each, precision = np.eye(MODES) / cycles, np.eye(MODES)
    for k in range(MODES):
        information = math.sqrt(max(squares[k], 0.0))
        for i in range(MODES):
            for j in range(MODES):
                product = information * turned[i, k] * turned[j, k]
                each[i, j] += product / math.sqrt(cycles)
                precision[i, j] += product / math.sqrt(2.0)
    # in units of the noise of one cycle
    root = small_linalg.cholesky(each)
    values, vectors = np.linalg.eigh(
        small_linalg.transposed_product(small_linalg.transposed_product(unbiased, root), root)
    )
    # what noise alone makes of six zeros at most (Marchenko & Pastur 1967) says nothing
    edge = (1.0 + math.sqrt(MODES / cycles)) ** 2 - 1.0
    for k in range(MODES):
        for i in range(MODES):
            vectors[i, k] *= math.sqrt(values[k]) if values[k] > edge else 0.0
    columns = small_linalg.solve_upper(root, vectors)
    # noise in n cycles hides a variance of sqrt(2 / n) of its own
    Lambda = small_linalg.inverse(precision)
    for i in range(MODES):
        for j in range(MODES):
            for k in range(MODES):
                Lambda[i, j] += columns[i, k] * columns[j, k]
    return Lambda


@compiled
def components(Lambda: Samples, B: Samples) -> Samples:
    """Principal components as columns, largest first, scaled to their standard deviations, shape (j, 6)."""
    values, vectors = np.linalg.eigh(Lambda)
    columns = np.zeros((len(B), MODES))
    for i in range(len(B)):
        for c in range(MODES):
            for k in range(MODES):
                columns[i, c] += B[i, k] * vectors[k, MODES - 1 - c]
            columns[i, c] *= math.sqrt(max(values[MODES - 1 - c], 0.0))
    return columns


@lru_cache(maxsize=8)
def cosines(coefficients: int) -> Samples:
    """Lowest cosines along the grid, of unit mean square, shape (j, 6)."""
    place = (np.arange(coefficients) + 0.5) / coefficients
    modes = np.cos(math.pi * np.outer(place, np.arange(MODES)))
    unit: Samples = modes / np.sqrt((modes**2).mean(axis=0))
    return unit


@compiled
def _add_to_sums(W: Samples, moment: Samples, share: float, weights: Samples, moments: Samples) -> None:
    """Add tr(E_p W E_q W) and tr(E_p moment) to the sums."""
    n = len(W)
    p = at = 0
    for i in range(n):
        for j in range(i, n):
            pairs = 1.0 if i == j else 2.0
            moments[p] += share * pairs * moment[i, j]
            p += 1
            for k in range(i + 1):
                for m in range(k, n if k < i else j + 1):
                    orders = 0.5 if k == m else 1.0
                    weights[at] += share * pairs * orders * (W[i, k] * W[j, m] + W[i, m] * W[j, k])
                    at += 1
