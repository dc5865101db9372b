"""Functional forms refitted through the simulation: which the data prefer, and which they cannot tell."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.laws.condense import RankedForm, is_simple
from impactcell.discrepancy.laws.free_term import FreeTerm
from impactcell.discrepancy.laws.grammar import Shaped, evaluate, name
from impactcell.discrepancy.laws.law import Law, write_law
from impactcell.discrepancy.model import Constraints, Fit, Problem, fit
from impactcell.errors import DiscrepancyError
from impactcell.physics import LawKind
from impactcell.records import Samples

REFITTED = 20
"""Forms that are fitted through the simulation, beside every single atom: near a fold or far from the spline
the ranking may err."""
RANGES = (0.03, 0.1, 0.3, 1.0)
"""Ranges of a pull that are tried, over the largest gap."""
SIMPLIFIED = 5
"""Laws, the best first, of which each part is then tried alone."""
FARTHEST = 3.0
"""Coordinates, most of them logarithms, by which a first-order step is believed: a factor of twenty."""
MOST_STEPS = 9
"""Gauss-Newton steps of each."""
TIED_SCORE = 6.0
"""Difference of score up to which forms are tied: e^6 to one, 1 in 400, after Kass and Raftery (1995)."""
TIED_DEVIATIONS, LARGEST_TIE = 2.2, 30.0
"""The same in standard deviations of its sum over shots, as for named effects, and the largest that is none:
a law that fails in a few shots is not in doubt because most do not show it."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedLaw:
    """A law fitted to the training shots.

    Attributes
    ----------
    score : float
        Log-likelihood less half the logarithm of the samples for each number of the law (Schwarz 1978).
    per_shot : ndarray, shape (n,)
        Log-likelihood of every shot.
    """

    law: Law
    ranked: RankedForm
    problem: Problem
    fit: Fit
    score: float
    per_shot: Samples

    @property
    def values(self) -> dict[str, float]:
        """Parameters of the law by name."""
        return {
            item.parameter: item.value(float(self.fit.theta[i]))
            for i, item in enumerate(self.fit.coordinates)
            if item.effect == self.law.identifier
        }

    def function(self, u: Samples) -> Samples:
        """Evaluate the law as it was fitted, at u of shape (n,), or u and w of shape (n, 2)."""
        return evaluate(self.law.expression, u, self.values)


def refit_forms(base: Fit, term: FreeTerm, ranked: Sequence[RankedForm]) -> list[FittedLaw]:
    """Fit forms through the simulation, the best first: of those that are tied the simplest."""
    # Functions of one covariate have been tried before those of two.
    simple = [entry for entry in ranked[REFITTED:] if is_simple(entry.form) and not term.form.second]
    fitted = _fitted(base, term, [*ranked[:REFITTED], *simple])
    known = {item.law.functional_form: item for item in fitted}
    simpler = {
        name(entry.form): entry
        for item in reversed(fitted[:SIMPLIFIED])
        for entry in _parts_alone(term, item)
        if name(entry.form) not in known or not tied_with(item, known[name(entry.form)])
    }
    best = dict(known)
    for item in _fitted(base, term, list(simpler.values())):
        form = item.law.functional_form
        if form not in best or item.score > best[form].score:
            best[form] = item
    laws = sorted(best.values(), key=lambda item: -item.score)
    tied = [item for item in laws if tied_with(laws[0], item)]
    simplest = min(tied, key=lambda item: (len(item.law.parameters), -item.score), default=None)
    return laws if simplest is None else [simplest, *(item for item in laws if item is not simplest)]


def _fitted(base: Fit, term: FreeTerm, forms: Sequence[RankedForm]) -> list[FittedLaw]:
    fitted = []
    for entry in forms:
        try:
            fitted.append(_refit(base, term, entry))
        except DiscrepancyError:
            continue
    return sorted(fitted, key=lambda item: -item.score)


def _parts_alone(term: FreeTerm, fitted: FittedLaw) -> list[RankedForm]:
    """Take each part of a law alone, from where the whole came to rest.

    Of a sum each term: the plant may take up the other one. Of a product of functions of two covariates each
    function: the other one may have come to rest where it is constant. A wave, whose terms share its period,
    has no parts.
    """
    if fitted.law.is_wave:
        return []
    of_law = len(fitted.law.parameters)
    pairs = zip(fitted.fit.coordinates[-of_law:], fitted.fit.theta[-of_law:].tolist(), strict=True)
    values = iter([coordinate.value(number) for coordinate, number in pairs])
    shaped = []
    for item in fitted.ranked.terms:
        amplitude = next(values)
        shaped.append(
            (amplitude, Shaped(item.term, tuple(tuple(next(values) for _ in atom) for atom in item.shapes)))
        )
    references = [max(map(abs, ends)) for ends in term.visited.ranges]

    def mean(dropped: Shaped) -> float:
        return float(np.mean(dropped.values(term.visited.points, *references)))

    def alone(kept: Shaped, amplitude: float, constant: float) -> RankedForm:
        others = _taken_up(term, fitted, constant)[:-of_law]
        return RankedForm((kept,), (amplitude,), -math.inf, -math.inf, others)

    if len(shaped) == 2:
        return [
            alone(kept, amplitude, other * mean(dropped))
            for (amplitude, kept), (other, dropped) in (shaped, shaped[::-1])
        ]
    amplitude, product = shaped[0]
    if len(shaped) > 1 or len(product.term) != 2 or not term.form.second:
        return []
    factors = [Shaped((atom,), (shape,)) for atom, shape in zip(product.term, product.shapes, strict=True)]
    return [alone(kept, amplitude * mean(dropped), 0.0) for kept, dropped in (factors, factors[::-1])]


def _taken_up(term: FreeTerm, fitted: FittedLaw, constant: float) -> Samples:
    """Coordinates after the plant has taken up a constant function."""
    theta = fitted.fit.theta.copy()
    for place, coordinate in enumerate(fitted.fit.coordinates):
        if not coordinate.effect and coordinate.parameter == term.form.constant_is:
            value = coordinate.value(float(theta[place]))
            moved = value * (1.0 + constant) if term.form.is_factor else value + constant
            ends = coordinate.value(coordinate.lower), coordinate.value(coordinate.upper)
            theta[place] = coordinate.coordinate(min(max(moved, ends[0]), ends[1]))
    return theta


def _refit(base: Fit, term: FreeTerm, entry: RankedForm) -> FittedLaw:
    law = write_law(term.form, entry, term.visited.ranges)
    law.effect()
    held = {name: value for name, value in term.problem.constraints.held.items() if not _of(term, name)}
    problem = term.problem.constrained((*base.effects, law.identifier), Constraints(held))
    own = [
        coordinate.coordinate(parameter.first)
        for coordinate, parameter in zip(
            problem.coordinates[len(base.coordinates) :], law.parameters, strict=True
        )
    ]
    # Over many waves a first-order step of the others is worse than none.
    theta = np.concatenate([base.theta if law.is_wave else _within_bounds(entry.others, base), own])
    if law.place.law_kind is LawKind.PULL:
        theta = _with_best_range(problem, theta, term)
    fitted = fit(problem, theta, term.fit.shot_parameters, spread=term.fit.spread, most_steps=MOST_STEPS)
    per_shot = fitted.log_likelihood(problem.shots)
    cost = 0.5 * len(law.parameters) * math.log(fitted.residual.size)
    return FittedLaw(law, entry, problem, fitted, float(per_shot.sum()) - cost, per_shot)


def _within_bounds(theta: Samples, base: Fit) -> Samples:
    """Coordinates of a first-order step, which may have left all sense, within what a fit may look at."""
    lower = np.array([coordinate.lower for coordinate in base.coordinates])
    upper = np.array([coordinate.upper for coordinate in base.coordinates])
    usable = np.isfinite(theta) & (np.abs(theta - base.theta) < FARTHEST)
    return np.clip(np.where(usable, theta, base.theta), lower, upper)


def _with_best_range(problem: Problem, theta: Samples, term: FreeTerm) -> Samples:
    """Start with the range of a pull that suits the shots best."""
    starts = []
    for share in RANGES:
        start = theta.copy()
        start[-1] = problem.coordinates[-1].coordinate(share * term.visited.upper)
        starts.append(start)
    costs = [problem.evaluate(start, term.fit.shot_parameters, term.fit.spread).cost for start in starts]
    return starts[int(np.argmin(costs))]


def _of(term: FreeTerm, parameter: str) -> bool:
    """Whether a held parameter is the free-form term's."""
    return parameter.startswith(f"{term.form.effect.identifier}.")


def tied_with(best: FittedLaw, other: FittedLaw) -> bool:
    """Whether the data cannot tell two laws apart: by score, or by the scatter of what lies between."""
    difference = best.score - other.score
    scatter = float(np.std(best.per_shot - other.per_shot)) * math.sqrt(len(best.per_shot))
    return difference < max(TIED_SCORE, min(TIED_DEVIATIONS * scatter, LARGEST_TIE))
