"""A free-form term fitted through the simulation, as smooth as shots that it was not fitted to want it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from impactcell.discrepancy.data import IndexArray
from impactcell.discrepancy.laws.covariates import Visited, visited
from impactcell.discrepancy.laws.term_start import TermStart, fit_free_term
from impactcell.discrepancy.model import Fit, Problem, refit_shot_parameters
from impactcell.errors import DiscrepancyError
from impactcell.physics.bspline import spline_basis, tensor_basis
from impactcell.physics.free_column_forms import column_form
from impactcell.physics.free_form import FreeForm
from impactcell.physics.free_forms import FINER, FREE_FORMS
from impactcell.physics.free_pair_forms import FREE_PAIR_FORMS, column_pair_forms
from impactcell.records import Samples

SMOOTHNESS = (1e-6, 1e-4, 1e-2, 1.0)
"""Weights of the roughness that are tried, over the information that the data have of the coefficients."""
PLACES = 4
"""Places that are fitted, of those that promise most to first order."""
FIRST_TRY = 1e-4
"""Weight of the roughness at which places are compared."""
FINE_SMOOTHNESS = (1e-6, 1e-4, 1e-2)
"""Weights that are tried for a term with more pieces."""
FINE_FROM = 1.3
"""Mean squared residual from which on a term with more pieces is tried at the place."""
WORTH_MORE = 4.0
"""Times the least mean squared residual: places within it are fitted at the other weights too."""


@dataclass(frozen=True, slots=True, eq=False)
class FreeTerm:
    """A fitted free-form term.

    Attributes
    ----------
    form : FreeForm
    visited : Visited
    problem : Problem
        Training shots with the term in the model.
    fit : Fit
    smoothness : float
        Weight of the roughness that was chosen.
    check_per_shot : ndarray, shape (n,)
        Mean squared residual, 1 at the noise floor, of each training shot on which it was chosen; the
        deviation of its friction factor is one of them.
    """

    form: FreeForm
    visited: Visited
    problem: Problem
    fit: Fit
    smoothness: float
    check_per_shot: Samples

    @property
    def check(self) -> float:
        """Mean over those shots."""
        return float(np.mean(self.check_per_shot))

    @property
    def columns(self) -> IndexArray:
        """Places of the coefficients among the coordinates."""
        return np.array(
            [i for i, item in enumerate(self.fit.coordinates) if item.effect == self.form.effect.identifier],
            dtype=np.int64,
        )

    @property
    def coefficients(self) -> Samples:
        """Coefficients of the spline in the form's unit, shape (K,)."""
        items = self.fit.coordinates
        return np.array([items[i].value(float(self.fit.theta[i])) for i in self.columns.tolist()])

    @property
    def tested(self) -> tuple[tuple[str, str, tuple[float, float]], ...]:
        """Each covariate with its unit and the range that was gone through."""
        units = (self.form.covariate_unit, self.form.second_unit)
        return tuple(zip(self.form.covariates, units, self.visited.ranges, strict=False))

    def basis(self, points: Samples) -> Samples:
        """Values of its splines, shape (n, K), at points of shape (n,) or, of two covariates, (n, 2)."""
        span, spans = self.visited, self.form.spans
        if span.second is None:
            return spline_basis(points, span.lower, span.upper, spans)
        ends = ((span.lower, span.upper), (span.second.lower, span.second.upper))
        return tensor_basis(points, ends, spans)


def free_forms_of(problem: Problem) -> list[FreeForm]:
    """Every place at which a free-form term may act: those of any plant, and each column of `shots.csv`."""
    columns = problem.shots.items[0].columns if problem.shots.excitation.tests_between_shots else ()
    return [*FREE_FORMS.values(), *(column_form(name) for name, _ in columns)]


def pair_forms_of(problem: Problem) -> list[FreeForm]:
    """Every place at which a term of two covariates may act."""
    columns = problem.shots.items[0].columns if problem.shots.excitation.tests_between_shots else ()
    return [*FREE_PAIR_FORMS.values(), *(form for name, _ in columns for form in column_pair_forms(name))]


def candidate_terms(problem: Problem, base: Fit, forms: Sequence[FreeForm] = ()) -> list[FreeForm]:
    """Places at which a free-form term promises most, to first order, the best first; all without `forms`.

    The promise is the fall of the squared residuals over one step of all parameters, half of g' H⁺ g.
    """
    promise: list[tuple[float, FreeForm]] = []
    for form in forms or free_forms_of(problem):
        span = visited(problem, base, form)
        if span is None or not _may_act(problem, base, form):
            continue
        start = TermStart.at(problem, base, form, span)
        if start.has_answer:
            H, g = start.information + start.weighed(FIRST_TRY).penalty_matrix, start.gradient
            gain = float(g @ np.linalg.lstsq(H, g, rcond=1e-12)[0])
            promise.append((gain, form))
    return [form for _, form in sorted(promise, key=lambda entry: -entry[0])]


def fit_free_terms(problem: Problem, base: Fit, seed: int, forms: Sequence[FreeForm] = ()) -> list[FreeTerm]:
    """Fit a term at each of the most promising places; the one that predicts other shots best comes first.

    Without `forms` every place of a single covariate is looked at.
    """
    inner, check = problem.shots.excitation.split(problem.shots.items, seed)
    parts = problem.select(inner), problem.select(check)
    inner_base = _of_shots(base, inner, parts[0])
    trials: list[_Check] = []
    for form in candidate_terms(problem, base, forms)[:PLACES]:
        span = visited(problem, base, form)
        if span is not None:
            trials.append(_Check(parts, inner_base, TermStart.at(parts[0], inner_base, form, span)))
            trials[-1].try_weights((FIRST_TRY,))
    nearest = min((trial.least for trial in trials), default=np.inf)
    terms = []
    for rough in trials:
        if rough.least < WORTH_MORE * nearest:
            rough.try_weights(SMOOTHNESS)
        best = _finer(rough)
        form, span, errors = best.start.form, best.start.visited, best.errors[best.best]
        if not np.isfinite(errors).all():
            continue
        extended, whole = fit_free_term(problem, base, form, span, best.best)
        terms.append(FreeTerm(form, span, extended, whole, best.best, errors))
    return sorted(terms, key=lambda term: term.check)


def _finer(rough: "_Check") -> "_Check":
    """Take more pieces where a term leaves something and they leave less."""
    finer = FINER.get(rough.start.form.place)
    if finer is None or rough.least <= FINE_FROM:
        return rough
    start = TermStart.at(rough.parts[0], rough.base, finer, rough.start.visited)
    fine = _Check(rough.parts, rough.base, start)
    fine.try_weights(FINE_SMOOTHNESS)
    return fine if fine.least < rough.least else rough


@dataclass(slots=True, eq=False)
class _Check:
    """How well a term predicts shots that it was not fitted to, by the weight of its roughness.

    Attributes
    ----------
    parts : tuple of Problem
        Shots to fit, and shots to check.
    base : Fit
        Model without the term, of the first part.
    start : TermStart
    errors : dict of float to ndarray, shape (n,)
        Mean squared residual, and factor, of each shot of the second part; inf where there is no fit.
    """

    parts: tuple[Problem, Problem]
    base: Fit
    start: TermStart
    errors: dict[float, Samples] = field(default_factory=dict)

    @property
    def best(self) -> float:
        """Weight that predicts best."""
        return min(self.errors, key=lambda weight: float(np.mean(self.errors[weight])))

    @property
    def least(self) -> float:
        """Mean error at that weight."""
        return float(np.mean(self.errors[self.best]))

    def try_weights(self, weights: Sequence[float]) -> None:
        """Fit and check at weights that have not been tried."""
        for weight in weights:
            if weight not in self.errors:
                self.errors[weight] = self._error(weight)

    def _error(self, weight: float) -> Samples:
        check = self.parts[1]
        try:
            extended, fitted = self.start.fit(weight)
        except DiscrepancyError:
            return np.full(check.count, np.inf)
        held = refit_shot_parameters(check.constrained(extended.effects, extended.constraints), fitted)
        factors = (held.shot_parameters.log_factor / self.base.spread) ** 2
        errors: Samples = (held.misfit(check.shots) + factors) / (check.sizes + 1)
        return errors


def _may_act(problem: Problem, base: Fit, form: FreeForm) -> bool:
    """Whether the excitation shows the term, and no effect of the model takes its only place."""
    has_contact = problem.shots.excitation.has_contact
    in_contact = form.covariate in {"indentation", "indentation_rate", "gap", "time", "force"}
    if in_contact and not has_contact:
        return False
    return not (form.covariate == "gap" and "adhesion" in base.effects)


def _of_shots(base: Fit, indices: IndexArray, part: Problem) -> Fit:
    """Give the same fit, of some of its shots."""
    shot_parameters = base.shot_parameters.select(indices)
    residual = part.with_effects(base.effects).residual(base.theta, shot_parameters)
    return Fit(base.effects, base.coordinates, base.theta, shot_parameters, base.spread, residual)
