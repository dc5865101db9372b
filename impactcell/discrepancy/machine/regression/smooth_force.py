"""Evidence for a term beside a smooth force of position and speed of which nobody knows the form.

What a model of a real machine leaves is such a force as a rule, and any term closes some of it. A term is
there if what is left without it is no smooth force, or needs a clearly larger one: the force has one level in
all its directions, so that it must not be large along the term alone.
"""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from impactcell.discrepancy.machine.regression.block_sums import RIDGE
from impactcell.discrepancy.machine.regression.weak_form import Column, IndexArray, Rows
from impactcell.discrepancy.machine.terms.base_model import NumberPrior, Reach
from impactcell.discrepancy.machine.terms.catalogue import MotionState
from impactcell.discrepancy.machine.terms.rival_forms import Ranges, columns_of_corners
from impactcell.discrepancy.machine.terms.smooth_waves import spectrum, waves_at
from impactcell.records import Samples

NAME = "smooth_force"
"""Name of its columns."""
LENGTHS = (0.4, 0.8)
"""Correlation lengths that are tried, over half the range that was gone through [1]."""
LEVELS = np.geomspace(1e-3, 1e3, 25)
"""Its standard deviations that are tried, over that of what nothing explains."""
NUISANCE_STD = 10.0
"""Standard deviation of a nuisance that is free, over the size at which it would explain all there is [1]."""

Need = Callable[[Sequence[Column], float], float]
"""Logarithm of how much likelier rows are with a term beside a model and a smooth force.

By the term's columns and the standard deviation of their strengths, over that at which one explains all that
the model leaves; -inf where a strength would be negative that may not be.
"""


def smooth_force_columns(motion: MotionState, direction: Samples, ranges: Ranges) -> dict[Column, Samples]:
    """Waves that a smooth force is made of beside the free forms of `columns_of_corners`, shape (n,) each."""
    columns = columns_of_corners(motion, direction, ranges)
    waves = waves_at(motion.position, motion.velocity, reach_of(ranges))
    return columns | {(NAME, 0.0, number): wave for number, wave in enumerate(waves)}


def reach_of(ranges: Ranges) -> Reach:
    """Positions and speeds that were gone through."""
    return Reach(ranges["position"], ranges["speed"][1])


class SmoothForce:
    """Rows of a machine beside a smooth force of unknown level and correlation length.

    Rows r ~ N(X c, s² (V + k² P P')) with V the sensors' variances, P the waves by their spectrum, k the
    level, s at least 1, and c ~ N(0, s² D / s_0²), s_0 the s of the model that a term is put beside; k and
    the length are averaged over, s is of the largest likelihood, and what overlaps counts as
    fewer independent rows.

    Parameters
    ----------
    rows : Rows
        With columns of `smooth_force_columns`, as they are fitted.
    chosen : ndarray of bool, shape (n,)
        Rows that count.
    pieces : float
        Independent ones that these rows count for.
    priors : mapping
        Of the nuisances.
    nonnegative : frozenset of Column
        Strengths that may not be negative.
    """

    def __init__(
        self,
        rows: Rows,
        chosen: np.ndarray,
        pieces: float,
        priors: Mapping[Column, NumberPrior],
        nonnegative: frozenset[Column],
    ) -> None:
        self._pieces = min(pieces, float(chosen.sum()))
        sigma = np.sqrt(rows.variance[chosen] * chosen.sum() / self._pieces)
        names = [name for name in rows.columns if name[0] != NAME]
        waves = [name for name in rows.columns if name[0] == NAME]
        self._place = {name: place for place, name in enumerate(names)}
        stacked = np.stack([*(rows.columns[name][chosen] for name in names), rows.target[chosen]], axis=1)
        stacked /= sigma[:, None]
        self._whole = stacked.T @ stacked
        self._priors = priors
        self._nonnegative = nonnegative
        shapes = np.stack([rows.columns[name][chosen] for name in waves], axis=1) / sigma[:, None]
        self._forces = [self._force(shapes * np.sqrt(spectrum(length)), stacked) for length in LENGTHS]

    def beside(self, columns: Sequence[Column]) -> Need:
        """Put a model, by its columns, beside the force."""
        scale = self._precisions(columns)
        _, spread = self._weigh(columns, (), scale)
        precision = spread * scale
        without, _ = self._weigh(columns, (), precision)

        def need(term: Sequence[Column], size: float) -> float:
            of_term = precision.copy()
            of_term[[self._place[column] for column in term]] /= size**2
            return self._weigh(columns, term, of_term)[0] - without

        return need

    def _force(self, waves: Samples, stacked: Samples) -> tuple[Samples, Samples]:
        """Take apart what V + k² P P' takes of products, by the eigenvectors of P' P (Woodbury).

        Its waves as they are seen in columns and target, shape (w, p + 1), and their sizes, shape (w,), if
        together they have the size of the noise.
        """
        waves = waves / math.sqrt(max(float((waves**2).sum()), np.finfo(float).tiny) / self._pieces)
        sizes, vectors = np.linalg.eigh(waves.T @ waves)
        return vectors.T @ (waves.T @ stacked), np.maximum(sizes, 0.0)

    def _precisions(self, columns: Sequence[Column]) -> Samples:
        """Give 1/D of each column: what is new in a term may explain all that the model leaves.

        What is new in a term of the model may explain all that nuisances leave, and of nuisances D is their
        prior's variance.
        """
        precision = self._over_left(columns)
        own = [self._place[name] for name in columns]
        precision[own] = self._over_left([*self._priors])[own]
        size = np.maximum(np.diag(self._whole), np.finfo(float).tiny)
        for name, prior in self._priors.items():
            free = size[self._place[name]] / (NUISANCE_STD**2 * size[-1])
            precision[self._place[name]] = 1.0 / prior.std**2 if math.isfinite(prior.std) else free
        return precision

    def _over_left(self, columns: Sequence[Column]) -> Samples:
        """Squares of all columns over that of the target, each less what some columns explain of it."""
        places = [self._place[name] for name in columns]
        size = np.maximum(np.diag(self._whole), np.finfo(float).tiny)
        scaled = self._whole / np.outer(np.sqrt(size), np.sqrt(size))
        found = np.linalg.lstsq(scaled[np.ix_(places, places)], scaled[places], rcond=None)[0]
        of_target = zip(columns, found[:, -1], strict=True)
        beyond = {name for name, value in of_target if value < 0.0} & self._nonnegative
        if beyond:
            return self._over_left([name for name in columns if name not in beyond])
        left = size * np.maximum(1.0 - (scaled[places] * found).sum(axis=0), RIDGE)
        over: Samples = np.maximum(left[:-1] / max(left[-1], np.finfo(float).tiny), np.finfo(float).tiny)
        return over

    def _weigh(
        self, columns: Sequence[Column], term: Sequence[Column], precision: Samples
    ) -> tuple[float, float]:
        """Logarithm of the evidence of a model and a term beside it, and s² at the level of the largest."""
        places = np.array([self._place[column] for column in (*columns, *term)], dtype=np.int64)
        bounded = np.array([column in self._nonnegative for column in (*columns, *term)], dtype=bool)
        is_own = np.arange(len(places)) >= len(columns)
        bounds = bounded, is_own
        found = [self._at(force, LEVELS**2, places, bounds, precision[places]) for force in self._forces]
        values, spreads = (np.concatenate(part) for part in zip(*found, strict=True))
        return float(np.logaddexp.reduce(values)) - math.log(len(values)), float(spreads[np.argmax(values)])

    def _at(
        self,
        force: tuple[Samples, Samples],
        levels: Samples,
        places: IndexArray,
        bounds: tuple[np.ndarray, np.ndarray],
        precision: Samples,
    ) -> tuple[Samples, Samples]:
        """Logarithm of the evidence at some k², and s²; a strength of the model is 0, not negative."""
        bounded, is_own = bounds
        seen, sizes = force
        with_target = np.append(places, self._whole.shape[0] - 1)
        seen = seen[:, with_target]
        share = levels[:, None] / (1.0 + levels[:, None] * sizes)
        products = self._whole[np.ix_(with_target, with_target)] - (seen.T * share[:, None, :]) @ seen
        matrix = products[:, :-1, :-1] + np.diag(precision)
        size = np.sqrt(np.diagonal(matrix, axis1=1, axis2=2))
        right = products[:, :-1, -1] / size
        scaled = matrix / (size[:, :, None] * size[:, None, :])
        found = np.linalg.solve(scaled, right[:, :, None])[:, :, 0]
        left = np.maximum(products[:, -1, -1] - (right * found).sum(axis=1), 0.0)
        spread = np.maximum(left / self._pieces, 1.0)
        volume = np.linalg.slogdet(scaled)[1] + np.log(size**2 / precision).sum(axis=1)
        volume += np.log1p(levels[:, None] * sizes).sum(axis=1)
        values = -0.5 * (self._pieces * np.log(spread) + left / spread + volume)
        beyond = bounded & (found < 0.0)
        for pattern in np.unique(beyond[beyond.any(axis=1)], axis=0):
            alike = (beyond == pattern).all(axis=1)
            if np.any(pattern & is_own):
                values[alike] = -math.inf
                continue
            kept = ~pattern
            values[alike], spread[alike] = self._at(
                force, levels[alike], places[kept], (bounded[kept], is_own[kept]), precision[kept]
            )
        return values, spread
