"""Evidence for a term beside a smooth force of position and speed of which nobody knows the form.

What a model of a real machine leaves is such a force as a rule, and any term closes some of it. A term is
there if what is left without it is no smooth force, or needs a clearly larger one: the force has one level in
all its directions, so that it must not be large along the term alone.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.machine.base_model import NumberPrior
from impactcell.discrepancy.machine.regression import PIECES_PER_BLOCK
from impactcell.discrepancy.machine.rival_forms import Ranges, columns_of_corners
from impactcell.discrepancy.machine.terms import MotionState
from impactcell.discrepancy.machine.weak_form import Column, Rows
from impactcell.records import Samples

NAME = "smooth_force"
"""Name of its columns."""
WAVES = 8
"""Waves along position, and as many along velocity [1]."""
BOX = 1.5
"""Half width of what they are waves in, over half the range that was gone through [1]."""
LENGTHS = (0.4, 0.8)
"""Correlation lengths that are tried, over half the range that was gone through [1]."""
LEVELS = np.geomspace(1e-3, 1e3, 25)
"""Its standard deviations that are tried, over that of what nothing explains."""
NUISANCE_STD = 10.0
"""Standard deviation of a nuisance that is free, over the size at which it would explain all there is [1]."""


def smooth_force_columns(motion: MotionState, direction: Samples, ranges: Ranges) -> dict[Column, Samples]:
    """Waves that a smooth force is made of, beside the free forms of `columns_of_corners`; shape (n,) each.

    sin(i pi (x + L) / (2 L)) sin(j pi (u + L) / (2 L)) / L, x of position and u of velocity over half their
    ranges, L = `BOX` (Solin and Särkkä 2020, doi:10.1007/s11222-019-09886-w, eq. 32).
    """
    low, high = ranges["position"]
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), np.finfo(float).tiny)
    along = _waves((motion.position - middle) / half)
    over = _waves(motion.velocity / max(ranges["speed"][1], np.finfo(float).tiny))
    columns = columns_of_corners(motion, direction, ranges)
    for i, one in enumerate(along):
        for j, two in enumerate(over):
            columns[NAME, 0.0, i * WAVES + j] = one * two
    return columns


def _waves(values: Samples) -> Samples:
    """Waves in the box, shape (WAVES, n)."""
    number = np.arange(1, WAVES + 1)[:, None]
    waves: Samples = np.sin(number * np.pi * (values + BOX) / (2.0 * BOX)) / math.sqrt(BOX)
    return waves


def _spectrum(length: float) -> Samples:
    """Variances of the waves of a force of one correlation length, in the order of its columns.

    2 pi l² exp(-l² |w|² / 2), w the angular frequencies of a wave (ibid., eq. 3).
    """
    frequency = np.arange(1, WAVES + 1) * np.pi / (2.0 * BOX)
    square = np.add.outer(frequency**2, frequency**2).ravel()
    spectrum: Samples = 2.0 * np.pi * length**2 * np.exp(-0.5 * length**2 * square)
    return spectrum


@dataclass(frozen=True, slots=True, eq=False)
class _Level:
    """Products of all columns and the target in the metric of one smooth force, and its log-determinant."""

    products: Samples
    log_determinant: float


class SmoothForce:
    """Rows of a machine beside a smooth force of unknown level and correlation length.

    Rows r ~ N(X c, s² (V + k² P P')) with V the sensors' variances, P the waves by their spectrum, k the
    level, s at least 1, and c ~ N(0, s² D); k and the length are averaged over, s is of the largest
    likelihood, and what overlaps counts as `PIECES_PER_BLOCK` independent rows a block.

    Parameters
    ----------
    rows : Rows
        With columns of `smooth_force_columns`, as they are fitted.
    chosen : ndarray of bool, shape (n,)
        Rows that count.
    blocks : int
        That these rows make.
    priors : mapping
        Of the nuisances.
    nonnegative : frozenset of Column
        Strengths that may not be negative.
    """

    def __init__(
        self,
        rows: Rows,
        chosen: np.ndarray,
        blocks: int,
        priors: Mapping[Column, NumberPrior],
        nonnegative: frozenset[Column],
    ) -> None:
        self._pieces = min(PIECES_PER_BLOCK * blocks, float(chosen.sum()))
        sigma = np.sqrt(rows.variance[chosen] * chosen.sum() / self._pieces)
        names = [name for name in rows.columns if name[0] != NAME]
        waves = [name for name in rows.columns if name[0] == NAME]
        self._place = {name: place for place, name in enumerate(names)}
        stacked = np.stack([*(rows.columns[name][chosen] for name in names), rows.target[chosen]], axis=1)
        stacked /= sigma[:, None]
        self._whole = stacked.T @ stacked
        self._nonnegative = nonnegative
        self._precision = self._precisions(priors)
        shapes = np.stack([rows.columns[name][chosen] for name in waves], axis=1) / sigma[:, None]
        self._levels = [*self._by_level(shapes, stacked)]

    def _precisions(self, priors: Mapping[Column, NumberPrior]) -> Samples:
        """Prior precision of each coefficient over 1/s²: a term may explain all that nuisances leave."""
        size = np.maximum(np.diag(self._whole), np.finfo(float).tiny)
        own = [self._place[name] for name in priors]
        scaled = self._whole / np.outer(np.sqrt(size), np.sqrt(size))
        found = np.linalg.lstsq(scaled[np.ix_(own, own)], scaled[own, -1], rcond=None)[0]
        left = size[-1] * max(1.0 - float(scaled[own, -1] @ found), np.finfo(float).eps)
        precision: Samples = size[:-1] / left
        for name, prior in priors.items():
            free = size[self._place[name]] / (NUISANCE_STD**2 * size[-1])
            precision[self._place[name]] = 1.0 / prior.std**2 if math.isfinite(prior.std) else free
        return precision

    def _by_level(self, shapes: Samples, stacked: Samples) -> Iterator[_Level]:
        """Invert V + k² P P' by the eigenvectors of P' P (Woodbury)."""
        for length in LENGTHS:
            waves = shapes * np.sqrt(_spectrum(length))
            waves /= math.sqrt(max(float((waves**2).sum()), np.finfo(float).tiny) / self._pieces)
            sizes, vectors = np.linalg.eigh(waves.T @ waves)
            sizes = np.maximum(sizes, 0.0)
            seen = vectors.T @ (waves.T @ stacked)
            for level in LEVELS:
                share = level**2 / (1.0 + level**2 * sizes)
                products = self._whole - (seen.T * share) @ seen
                yield _Level(products, float(np.log1p(level**2 * sizes).sum()))

    def evidence(self, columns: Sequence[Column], term: Sequence[Column] = (), size: float = 1.0) -> float:
        """Logarithm of the evidence of a model and a term beside it.

        `size`: standard deviation of the term's strengths, over that at which one explains all there is.
        -inf where a strength of the term would be negative that may not be.
        """
        every = (*columns, *term)
        places = np.array([self._place[column] for column in every])
        bounded = np.array([column in self._nonnegative for column in every])
        is_own = np.arange(len(every)) >= len(columns)
        precision = self._precision[places] / np.where(is_own, size**2, 1.0)
        values = [self._at(level, places, (bounded, is_own), precision) for level in self._levels]
        return float(np.logaddexp.reduce(values)) - math.log(len(values))

    def _at(
        self, level: _Level, places: np.ndarray, bounds: tuple[np.ndarray, np.ndarray], precision: Samples
    ) -> float:
        """Logarithm of the evidence at one level; a strength of the model that would be negative is 0."""
        bounded, is_own = bounds
        matrix = level.products[np.ix_(places, places)] + np.diag(precision)
        size = np.sqrt(np.diag(matrix))
        right = level.products[places, -1] / size
        scaled = matrix / np.outer(size, size)
        found = np.linalg.lstsq(scaled, right, rcond=None)[0]
        beyond = bounded & (found < 0.0)
        if np.any(beyond & is_own):
            return -math.inf
        if beyond.any():
            return self._at(level, places[~beyond], (bounded[~beyond], is_own[~beyond]), precision[~beyond])
        left = max(float(level.products[-1, -1] - right @ found), 0.0)
        spread = max(left / self._pieces, 1.0)
        volume = float(np.linalg.slogdet(scaled)[1] + np.log(size**2 / precision).sum())
        fit = self._pieces * math.log(spread) + left / spread
        return -0.5 * (fit + level.log_determinant + volume)
