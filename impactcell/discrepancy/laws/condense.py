"""From a fitted spline to functional forms, ranked by what they keep of its gain; no simulation is needed.

Near the fitted spline the log-likelihood is a quadratic function of its coefficients c, h'c - c'S c / 2, with
the information S after plant, other effects and every shot's own numbers have been eliminated. A form is
projected on the spline; its amplitudes follow in closed form, its shapes by a search from a grid. Directions
that the plant would take up by itself have no information and cost a form nothing.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import fmin

from impactcell.discrepancy.data import IndexArray
from impactcell.discrepancy.laws.grammar import (
    WAVE_ATOMS,
    WAVES,
    Atom,
    Form,
    Shaped,
    name,
    shaped_pairs,
    shaped_terms,
)
from impactcell.discrepancy.laws.tangent import Tangent
from impactcell.physics.bspline import spline_basis, tensor_basis
from impactcell.physics.free_form import ACROSS
from impactcell.records import Samples

GRID = 240
"""Points of the range on which a form is projected on the spline: three for each of the most pieces."""
PAIR_GRID = (48, 16)
"""The same along a first and a second covariate: four for each piece, and more than the four splines."""
WAVE_CYCLES, WAVE_STEP = 25.0, 0.1
"""Most cycles of a wave in the range, a third of the most pieces, and how finely they are gone through."""
PAIRS = 400
"""Single-atom terms that are paired into sums, the best first."""
PRODUCTS = 30
"""Products of a function of each of two covariates that are refined whatever their rank, the best first."""
REFINED = 60
"""Forms whose shapes are refined."""
TRIED_PAIRS = 50 * REFINED
"""Sums of two that are offered, the best first: one form comes with some fifty starts."""
SINGULAR = 1e-9
"""Relative determinant below which two terms are one."""
WIDEST_STEP, FARTHEST = 0.25, 2.0
"""First step of a shape's search, and how far it may go, in its logarithm or as a share of the range."""
EVALUATIONS, SETTLED_SHAPE, SETTLED_GAIN = 80, 1e-3, 0.05
"""Evaluations for each shape, and where its search ends, in the same units and in log-likelihood."""


@dataclass(frozen=True, slots=True, eq=False)
class RankedForm:
    """A functional form with the numbers at which it comes nearest to the spline.

    Attributes
    ----------
    gain : float
        Of log-likelihood over the model without any term, to second order.
    score : float
        Gain less half the logarithm of the samples for each number (Schwarz 1978).
    others : ndarray, shape (p,)
        Where all other coordinates go with it.
    """

    terms: tuple[Shaped, ...]
    amplitudes: tuple[float, ...]
    gain: float
    score: float
    others: Samples

    @property
    def form(self) -> Form:
        """Functional form alone."""
        return tuple(item.term for item in self.terms)


def rank_forms(quadratic: Tangent) -> list[RankedForm]:
    """Functional forms, the best first; one entry a form."""
    projector = _Projector(quadratic)
    if quadratic.second is None:
        singles = list(shaped_terms(quadratic.lower, quadratic.upper, constant=quadratic.constant))
    else:
        singles = list(shaped_pairs(quadratic.ranges[0], quadratic.second, constant=quadratic.constant))
    columns = np.array([projector.coefficients(item) for item in singles])
    h, gram = projector.against(columns)
    best: dict[str, tuple[float, tuple[Shaped, ...]]] = {}

    def offer(score: float, terms: tuple[Shaped, ...]) -> None:
        key = name(tuple(item.term for item in terms))
        if score > best.get(key, (-math.inf, ()))[0]:
            best[key] = (score, terms)

    diagonal = np.maximum(np.diag(gram), 1e-300)
    gains = 0.5 * h**2 / diagonal
    cost = 0.5 * math.log(quadratic.samples)
    numbers = np.array([1 + item.shape_count for item in singles])
    for i in np.argsort(-(gains - cost * numbers)).tolist():
        offer(float(gains[i] - cost * numbers[i]), (singles[i],))
    plain = [i for i, item in enumerate(singles) if len(item.term) == 1 or quadratic.second is not None]
    chosen = sorted(plain, key=lambda i: -(gains[i] - cost * numbers[i]))[:PAIRS]
    chosen += [i for i in plain if i not in set(chosen) and singles[i].shape_count == 0]
    for score, i, j in _best_pairs(np.array(chosen), h, gram, cost, numbers):
        if not _is_wave(singles[i], singles[j]) or singles[i].shapes == singles[j].shapes:
            offer(score, (singles[i], singles[j]))
    order = [terms for _, terms in sorted(best.values(), key=lambda entry: -entry[0])]
    in_turn = _to_be_refined(order, has_products=bool(quadratic.second))
    refined = [projector.refine(terms, cost) for terms in in_turn]
    waves = [projector.wave(cost)] if quadratic.second is None else []
    return sorted([*refined, *waves], key=lambda item: -item.score)


def _best_pairs(
    chosen: IndexArray, h: Samples, gram: Samples, cost: float, numbers: IndexArray
) -> Iterator[tuple[float, int, int]]:
    """Score and both terms of the sums of two, the best first: gain of both at once less what they cost."""
    diagonal = np.maximum(np.diag(gram), 1e-300)
    a, b = np.triu_indices(len(chosen), 1)
    i, j = chosen[a], chosen[b]
    determinant = diagonal[i] * diagonal[j] - gram[i, j] ** 2
    usable = determinant > SINGULAR * diagonal[i] * diagonal[j]
    i, j, determinant = i[usable], j[usable], determinant[usable]
    score = 0.5 * (diagonal[j] * h[i] ** 2 - 2.0 * gram[i, j] * h[i] * h[j] + diagonal[i] * h[j] ** 2)
    score = score / determinant - cost * (numbers[i] + numbers[j])
    for place in np.argsort(-score)[:TRIED_PAIRS].tolist():
        yield float(score[place]), int(i[place]), int(j[place])


def _to_be_refined(
    order: Sequence[tuple[Shaped, ...]], *, has_products: bool
) -> Iterator[tuple[Shaped, ...]]:
    """Give the best forms, and of the rest what is simple.

    At few starts a sum may stand in for one product between them: products alone are given as well.
    """
    rest = order[REFINED:]
    yield from order[:REFINED]
    if has_products:
        yield from [terms for terms in rest if len(terms) == 1 and len(terms[0].term) == 2][:PRODUCTS]
    yield from (terms for terms in rest if is_simple(tuple(item.term for item in terms)))


def is_simple(form: Form) -> bool:
    """Whether a form is one atom, or a wave of any phase: these are looked at whatever their rank."""
    return list(map(len, form)) == [1] or {term[0].name for term in form if len(term) == 1} == set(WAVES)


def _is_wave(one: Shaped, other: Shaped) -> bool:
    return {one.term[0].name, other.term[0].name} == set(WAVES)


class _Projector:
    """Projects functions on the spline, in the sense of what the data know of it."""

    def __init__(self, quadratic: Tangent) -> None:
        self.quadratic = quadratic
        count = len(quadratic.pull)
        if quadratic.second is None:
            self.points = np.linspace(quadratic.lower, quadratic.upper, GRID)
            basis = spline_basis(self.points, quadratic.lower, quadratic.upper, count - 3)
        else:
            axes = [np.linspace(*ends, n) for ends, n in zip(quadratic.ranges, PAIR_GRID, strict=True)]
            self.points = np.column_stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")])
            basis = tensor_basis(self.points, quadratic.ranges, count // ACROSS - 3)
        self.inverse = np.linalg.pinv(basis)

    def coefficients(self, item: Shaped) -> Samples:
        """Coefficients of the spline that is nearest to a term of amplitude one."""
        out: Samples = self.inverse @ item.values(self.points, *self.quadratic.references)
        return out

    def against(self, columns: Samples) -> tuple[Samples, Samples]:
        """Give the pulls on amplitudes, and their information."""
        return columns @ self.quadratic.pull, columns @ self.quadratic.information @ columns.T

    def amplitudes(self, terms: tuple[Shaped, ...]) -> tuple[Samples, float]:
        """Best amplitudes of terms, and their gain."""
        h, gram = self.against(np.array([self.coefficients(item) for item in terms]))
        values = np.asarray(np.linalg.lstsq(gram, h, rcond=1e-12)[0], dtype=np.float64)
        return values, 0.5 * float(values @ h)

    def _ends(self, atom: Atom) -> tuple[float, float]:
        """Range of the covariate that an atom is of."""
        return self.quadratic.ranges[int(atom.second)]

    def _inside(self, item: Shaped) -> bool:
        """Whether every centre lies in the range gone through."""
        return all(
            self._ends(atom)[0] < value < self._ends(atom)[1]
            for atom, values in zip(item.term, item.shapes, strict=True)
            for shape, value in zip(atom.shapes, values, strict=True)
            if shape.name == "centre"
        )

    def wave(self, cost: float) -> RankedForm:
        """Wave of any phase that is nearest to the fitted spline itself.

        Over many waves the likelihood is no quadratic: a slip of a quarter of one turns its slope around.
        """
        lower, upper, fitted = self.quadratic.lower, self.quadratic.upper, self.quadratic.fitted
        values = spline_basis(self.points, lower, upper, len(fitted) - 3) @ fitted

        def projected(cycles: float) -> tuple[float, tuple[Shaped, ...], Samples]:
            terms = tuple(Shaped((atom,), (((upper - lower) / cycles,),)) for atom in WAVE_ATOMS)
            columns = [item.values(self.points, *self.quadratic.references) for item in terms]
            design = np.column_stack([*columns, np.ones(len(self.points))])
            amplitudes = np.asarray(np.linalg.lstsq(design, values)[0], dtype=np.float64)
            return float(np.sum((values - design @ amplitudes) ** 2)), terms, amplitudes[:2]

        cycles = np.arange(WAVE_STEP, WAVE_CYCLES, WAVE_STEP).tolist()
        _, terms, amplitudes = min(map(projected, cycles), key=lambda entry: entry[0])
        coefficients = amplitudes @ np.array([self.coefficients(item) for item in terms])
        others = self.quadratic.others + self.quadratic.response @ coefficients
        h, gram = self.against(np.array([self.coefficients(item) for item in terms]))
        gain = float(amplitudes @ h - 0.5 * amplitudes @ gram @ amplitudes)
        return RankedForm(terms, tuple(amplitudes.tolist()), gain, gain - 3.0 * cost, others)

    def refine(self, terms: tuple[Shaped, ...], cost: float) -> RankedForm:
        """Move the shapes to where the gain is largest."""
        wave = len(terms) == 2 and _is_wave(*terms)
        free = terms[:1] if wave else terms
        start = np.array([value for item in free for atom in item.shapes for value in atom])
        kinds = [
            (shape, self._ends(atom)[1] - self._ends(atom)[0])
            for item in free
            for atom in item.term
            for shape in atom.shapes
        ]

        def placed(x: Samples) -> tuple[Shaped, ...]:
            moved = [
                float(origin + width * step) if kind.name == "centre" else float(origin * math.exp(step))
                for origin, step, (kind, width) in zip(start, x, kinds, strict=True)
            ]
            numbers = iter(moved)
            out = tuple(
                Shaped(item.term, tuple(tuple(next(numbers) for _ in atom) for atom in item.shapes))
                for item in free
            )
            return (out[0], Shaped(terms[1].term, out[0].shapes)) if wave else out

        def lost(x: Samples) -> float:
            """Gain with its sign changed; 0 where a shape has left the range."""
            if float(np.abs(x).max()) > FARTHEST or not all(map(self._inside, placed(x))):
                return 0.0
            return -self.amplitudes(placed(x))[1]

        best = terms
        if len(start):
            found = fmin(
                lost,
                np.zeros(len(start)),
                initial_simplex=np.vstack([np.zeros(len(start)), WIDEST_STEP * np.eye(len(start))]),
                maxfun=EVALUATIONS * len(start),
                xtol=SETTLED_SHAPE,
                ftol=SETTLED_GAIN,
                disp=False,
            )
            best = placed(np.asarray(found, dtype=np.float64))
        values, gain = self.amplitudes(best)
        numbers = len(best) + len(start)
        coefficients = values @ np.array([self.coefficients(item) for item in best])
        others = self.quadratic.others + self.quadratic.response @ coefficients
        return RankedForm(best, tuple(values.tolist()), gain, gain - cost * numbers, others)
