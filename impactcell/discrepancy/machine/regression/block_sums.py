"""Least squares over blocks: every model is a small system made of the blocks' own sums."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.stats import chi2

from impactcell.discrepancy.machine.regression.block_scatter import half_intervals
from impactcell.discrepancy.machine.regression.weak_form import Column, IndexArray, Rows
from impactcell.discrepancy.machine.terms.base_model import PRIOR_REACH, NumberPrior
from impactcell.discrepancy.search import MAX_EXPECTED_GAP
from impactcell.records import Samples

RIDGE = 1e-9
"""Relative ridge of the normal equations: of columns that cannot be told apart neither runs away [1]."""
SIZE_WEIGHT = 1e-6
"""Weight of the size of a free function, over the information that blocks have of its pieces: what no block
sees of it stays at zero [1]."""
PIECES_PER_BLOCK = 4.0
"""Independent pieces that a block counts for, of a period and with supports of a quarter of it [1]."""
BLOCKS_OF_RECORD = 100_000
"""Numbers of blocks that a record may have: a day of seconds [1]."""


@dataclass(frozen=True, eq=False)
class Blocks:
    """Sums of products over each block's rows.

    Attributes
    ----------
    names : tuple of Column
        Columns, in the order of the matrices; the target comes last.
    products : ndarray, shape (b, p + 1, p + 1)
    rows : ndarray, shape (b,)
    noise : ndarray, shape (b,)
        Sum of the rows' variances by the sensors' noise.
    fold : ndarray of int, shape (b,)
        Cross-validation leaves out one fold at a time.
    number : ndarray of int, shape (b,)
        Which blocks they are.
    pieces_each : float
        Independent pieces that one counts for, where a prior or chance is weighed against it.
    """

    names: tuple[Column, ...]
    products: Samples
    rows: Samples
    noise: Samples
    fold: IndexArray
    number: IndexArray
    pieces_each: float = PIECES_PER_BLOCK

    @cached_property
    def without_folds(self) -> Samples:
        """Sums of products over all blocks but those of each fold, in order, shape (f, p + 1, p + 1)."""
        without = [self.products[self.fold != one].sum(axis=0) for one in np.unique(self.fold)]
        return np.array(without).reshape(-1, *self.products.shape[1:])

    def __len__(self) -> int:
        """Count the blocks."""
        return len(self.rows)

    def beside(self, other: "Blocks") -> "Blocks":
        """Take these blocks and others of the same columns together."""
        return replace(
            self,
            products=np.concatenate([self.products, other.products]),
            rows=np.concatenate([self.rows, other.rows]),
            noise=np.concatenate([self.noise, other.noise]),
            fold=np.concatenate([self.fold, other.fold]),
            number=np.concatenate([self.number, other.number]),
        )

    @property
    def pieces(self) -> float:
        """Independent pieces of all of them."""
        return self.pieces_each * len(self)

    @property
    def largest_by_chance(self) -> float:
        """Largest gap that noise alone makes, once in forty: of few pieces a larger one than of many."""
        pieces = max(self.pieces, 1.0)
        return max(MAX_EXPECTED_GAP, math.sqrt(float(chi2.ppf(0.975, pieces)) / pieces))

    def places(self, columns: Iterable[Column]) -> list[int]:
        """Where columns stand in the matrices."""
        return [self.names.index(column) for column in columns]

    def losses(
        self, columns: Sequence[Column], coefficients: Samples, chosen: IndexArray | None = None
    ) -> Samples:
        """Squared residual of every block, or of those chosen, shape (b,)."""
        places = np.array([*self.places(columns), len(self.names)])
        every = np.arange(len(self)) if chosen is None else chosen
        vector = np.append(-coefficients, 1.0)
        losses: Samples = self.products[np.ix_(every, places, places)] @ vector @ vector
        return np.maximum(losses, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class LinearFit:
    """A fitted model.

    Attributes
    ----------
    columns : tuple of Column
    coefficients, low, high : ndarray, shape (p,)
        Values, and their 95 % intervals by the scatter between blocks.
    at_bound : ndarray of bool, shape (p,)
        A strength that would have been negative, or a nuisance beyond what its prior allows.
    """

    columns: tuple[Column, ...]
    coefficients: Samples
    low: Samples
    high: Samples
    at_bound: Samples


def blocks_of(
    rows: Rows, number: IndexArray, fold: Mapping[int, int], pieces_each: float = PIECES_PER_BLOCK
) -> Blocks:
    """Sum up each block's rows.

    Parameters
    ----------
    rows : Rows
    number : ndarray of int, shape (n,)
        Block of each row, with its record as the multiple of `BLOCKS_OF_RECORD`.
    fold : mapping
        Fold of each block that is wanted.
    pieces_each : float
        Independent pieces that a block counts for.
    """
    names = tuple(rows.columns)
    matrix = np.stack([*rows.columns.values(), rows.target], axis=1)
    products, counts, noise = [], [], []
    for block in fold:
        inside = number == block
        part = matrix[inside]
        products.append(part.T @ part)
        counts.append(float(inside.sum()))
        noise.append(float(rows.variance[inside].sum()))
    size = len(names) + 1
    stacked = np.array(products).reshape(-1, size, size)
    return Blocks(
        names,
        stacked,
        np.array(counts),
        np.array(noise),
        np.array([*fold.values()], dtype=np.int64),
        np.array([*fold], dtype=np.int64),
        pieces_each,
    )


def fit_blocks(
    blocks: Blocks,
    columns: Sequence[Column],
    priors: Mapping[Column, NumberPrior],
    nonnegative: frozenset[Column],
    level: float = 0.95,
) -> LinearFit:
    """Fit a model to blocks, with intervals of so much probability by the scatter between them."""
    whole = blocks.products.sum(axis=0)
    coefficients, at_bound = _solve(blocks, (whole, len(blocks)), columns, priors, nonnegative)
    places = blocks.places(columns)
    last = len(blocks.names)
    grams = blocks.products[np.ix_(range(len(blocks)), places, places)]
    scores = blocks.products[:, places, last] - grams @ coefficients
    matrix = whole[np.ix_(places, places)] + np.diag(prior_weight(blocks, columns, coefficients, priors))
    matrix += RIDGE * np.diag(np.diag(matrix))
    half = half_intervals(grams, scores, matrix, level)
    low = lower_ends(columns, coefficients - half, nonnegative)
    return LinearFit(tuple(columns), coefficients, low, coefficients + half, at_bound)


def lower_ends(columns: Sequence[Column], low: Samples, nonnegative: frozenset[Column]) -> Samples:
    """Cut lower ends of intervals at 0 where a strength cannot be negative, shape (p,)."""
    least = [0.0 if column in nonnegative else -math.inf for column in columns]
    cut: Samples = np.maximum(low, least)
    return cut


def roughness_penalty(blocks: Blocks, columns: Sequence[Column], weight: float) -> Samples:
    """Quadratic form of the bends of a function, made of pieces in a row, and of its size, shape (p, p).

    `weight` of the bends and `SIZE_WEIGHT` of the size are over the information that blocks have of a piece.
    """
    places, count = blocks.places(columns), len(columns)
    information = float(np.trace(blocks.products.sum(axis=0)[np.ix_(places, places)])) / count
    bends = np.diff(np.eye(count), n=2, axis=0)
    penalty: Samples = information * (weight * bends.T @ bends + SIZE_WEIGHT * np.eye(count))
    return penalty


def out_of_fold_losses(
    blocks: Blocks,
    columns: Sequence[Column],
    priors: Mapping[Column, NumberPrior],
    nonnegative: frozenset[Column],
    penalty: Samples | None = None,
) -> Samples:
    """Squared residual of each block under coefficients fitted without its fold, shape (b,).

    `penalty`, shape (p, p): a quadratic form of the coefficients that is added to the squared residuals of
    all blocks.
    """
    losses = np.empty(len(blocks))
    for fold, outside in zip(np.unique(blocks.fold), blocks.without_folds, strict=True):
        inside = np.flatnonzero(blocks.fold == fold)
        sums = outside, len(blocks) - len(inside)
        coefficients, _ = _solve(blocks, sums, columns, priors, nonnegative, penalty)
        losses[inside] = blocks.losses(columns, coefficients, inside)
    return losses


def _solve(
    blocks: Blocks,
    sums: tuple[Samples, int],
    columns: Sequence[Column],
    priors: Mapping[Column, NumberPrior],
    nonnegative: frozenset[Column],
    penalty: Samples | None = None,
) -> tuple[Samples, Samples]:
    """Coefficients on some blocks, and which of them stand at the end of what they may be.

    `sums`: of these blocks' products, and how many they are.
    """
    places = blocks.places(columns)
    total, count = sums
    gram, right = total[np.ix_(places, places)], total[places, -1]
    smooth = np.zeros_like(gram) if penalty is None else penalty * (count / len(blocks))
    lower = np.array([0.0 if column in nonnegative else -_reach(column, priors) for column in columns])
    upper = np.array([_reach(column, priors) for column in columns])
    held = np.zeros(len(columns), dtype=bool)
    coefficients = np.zeros(len(columns))
    for _ in range(len(columns) + 1):
        weight = np.zeros(len(columns))
        free = np.flatnonzero(~held)
        for _ in range(2):
            # The prior's weight goes by the scatter of what is left, known after a first fit.
            matrix = gram + smooth + np.diag(weight)
            matrix = matrix + RIDGE * np.diag(np.diag(matrix))
            beside = right[free] - matrix[np.ix_(free, np.flatnonzero(held))] @ coefficients[held]
            coefficients[free] = _solved(matrix[np.ix_(free, free)], beside)
            left = max(total[-1, -1] - 2.0 * coefficients @ right + coefficients @ gram @ coefficients, 0.0)
            weight = _weight(left / (blocks.pieces_each * count), columns, priors)
        beyond = ~held & ((coefficients < lower) | (coefficients > upper))
        if not beyond.any():
            break
        held |= beyond
        coefficients = np.where(held, np.clip(coefficients, lower, upper), coefficients)
    return coefficients, held


def _solved(matrix: Samples, right: Samples) -> Samples:
    """Solve normal equations whatever units their columns have: a cube of millimetres is 1e-9 m³."""
    size = _sizes(matrix)
    solved: Samples = np.linalg.lstsq(matrix / np.outer(size, size), right / size, rcond=None)[0] / size
    return solved


def _sizes(matrix: Samples) -> Samples:
    """Size of each column of a regression, by the diagonal of its normal equations; 1 where it is empty."""
    diagonal = np.diag(matrix)
    return np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))


def _reach(column: Column, priors: Mapping[Column, NumberPrior]) -> float:
    """How far a coefficient may go: a nuisance to two standard deviations of its prior."""
    return PRIOR_REACH * priors[column].std if column in priors else math.inf


def _weight(
    variance_per_piece: float, columns: Sequence[Column], priors: Mapping[Column, NumberPrior]
) -> Samples:
    return np.array(
        [
            variance_per_piece / priors[column].std ** 2
            if column in priors and math.isfinite(priors[column].std)
            else 0.0
            for column in columns
        ]
    )


def prior_weight(
    blocks: Blocks, columns: Sequence[Column], coefficients: Samples, priors: Mapping[Column, NumberPrior]
) -> Samples:
    """Weight of each column's prior against a model's squared residuals, shape (p,)."""
    left = float(blocks.losses(columns, coefficients).sum())
    return _weight(left / blocks.pieces, columns, priors)
