"""A free-form term fitted through the simulation, as smooth as shots that it was not fitted to want it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.data import IndexArray
from impactcell.discrepancy.laws.covariates import Visited, visited
from impactcell.discrepancy.model import (
    Constraints,
    Fit,
    FitState,
    Problem,
    Roughness,
    fit,
    normal_equations,
    refit_shot_parameters,
)
from impactcell.errors import DiscrepancyError
from impactcell.physics.free_column_forms import column_form
from impactcell.physics.free_form import FreeForm
from impactcell.physics.free_forms import FINER, FREE_FORMS, LOWER, UPPER
from impactcell.records import Samples

SMOOTHNESS = (1e-6, 1e-4, 1e-2, 1.0)
"""Weights of the roughness that are tried, over the information that the data have of the coefficients."""
RIDGE = 1e-9
"""Weight, over the same, of the size of the term: what the data cannot see of it stays at zero."""
MOST_STEPS = 9
"""Gauss-Newton steps of a free-form fit."""
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


def free_forms_of(problem: Problem) -> list[FreeForm]:
    """Every place at which a free-form term may act: those of any plant, and each column of `shots.csv`."""
    columns = problem.shots.items[0].columns if problem.shots.excitation.tests_between_shots else ()
    return [*FREE_FORMS.values(), *(column_form(name) for name, _ in columns)]


def candidate_terms(problem: Problem, base: Fit, forms: Sequence[FreeForm] = ()) -> list[FreeForm]:
    """Places at which a free-form term promises most, to first order, the best first; all without `forms`.

    The promise is the fall of the squared residuals over one step of all parameters, half of g' H⁺ g.
    """
    promise: list[tuple[float, FreeForm]] = []
    for form in forms or free_forms_of(problem):
        span = visited(problem, base, form)
        if span is None or not _may_act(problem, base, form):
            continue
        extended, state = _start(problem, base, form, span, FIRST_TRY)
        H, g = equations(extended, state)
        if np.isfinite(H).all() and np.isfinite(g).all():
            gain = float(g @ np.linalg.lstsq(H + extended.penalty_matrix, g, rcond=1e-12)[0])
            promise.append((gain, form))
    return [form for _, form in sorted(promise, key=lambda entry: -entry[0])]


def fit_free_terms(problem: Problem, base: Fit, seed: int) -> list[FreeTerm]:
    """Fit a term at each of the most promising places; the one that predicts other shots best comes first."""
    inner, check = problem.shots.excitation.split(problem.shots.items, seed)
    parts = problem.select(inner), problem.select(check)
    inner_base = _of_shots(base, inner, parts[0])
    first: list[tuple[FreeForm, Visited, dict[float, Samples]]] = []
    for form in candidate_terms(problem, base)[:PLACES]:
        span = visited(problem, base, form)
        if span is not None:
            first.append((form, span, {FIRST_TRY: _check(parts, inner_base, form, span, FIRST_TRY)}))
    nearest = min((float(np.mean(errors[FIRST_TRY])) for _, _, errors in first), default=np.inf)
    terms = []
    for coarse, span, tried in first:
        if float(np.mean(tried[FIRST_TRY])) < WORTH_MORE * nearest:
            for smoothness in set(SMOOTHNESS) - {FIRST_TRY}:
                tried[smoothness] = _check(parts, inner_base, coarse, span, smoothness)
        form, errors = _finer(parts, inner_base, (coarse, span, tried))
        smoothness = _best(errors)
        if not np.isfinite(errors[smoothness]).all():
            continue
        extended, whole = fit_free_term(problem, base, form, span, smoothness)
        terms.append(FreeTerm(form, span, extended, whole, smoothness, errors[smoothness]))
    return sorted(terms, key=lambda term: term.check)


def _finer(
    parts: tuple[Problem, Problem], base: Fit, coarse: tuple[FreeForm, Visited, dict[float, Samples]]
) -> tuple[FreeForm, dict[float, Samples]]:
    """Take more pieces where a term leaves something and they leave less."""
    form, span, errors = coarse
    finer, left = FINER.get(form.place), float(np.mean(errors[_best(errors)]))
    if finer is None or left <= FINE_FROM:
        return form, errors
    fine = {weight: _check(parts, base, finer, span, weight) for weight in FINE_SMOOTHNESS}
    return (finer, fine) if float(np.mean(fine[_best(fine)])) < left else (form, errors)


def _best(errors: dict[float, Samples]) -> float:
    return min(errors, key=lambda weight: float(np.mean(errors[weight])))


def _check(
    parts: tuple[Problem, Problem], base: Fit, form: FreeForm, span: Visited, smoothness: float
) -> Samples:
    """Mean squared residual, and factor, of each shot of the second part after a fit to the first; or inf."""
    try:
        extended, fitted = fit_free_term(parts[0], base, form, span, smoothness)
    except DiscrepancyError:
        return np.full(parts[1].count, np.inf)
    held = refit_shot_parameters(parts[1].constrained(extended.effects, extended.constraints), fitted)
    factors = (held.shot_parameters.log_factor / base.spread) ** 2
    errors: Samples = (held.misfit(parts[1].shots) + factors) / (parts[1].sizes + 1)
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


def _start(
    problem: Problem, base: Fit, form: FreeForm, span: Visited, smoothness: float
) -> tuple[Problem, FitState]:
    """Model with the term still at zero, its roughness weighed by what the data know of its coefficients."""
    identifier, count = form.effect.identifier, len(form.coefficients)
    held = {
        **problem.constraints.held,
        f"{identifier}.{LOWER}": span.lower,
        f"{identifier}.{UPPER}": span.upper,
    }
    effects = (*base.effects, identifier)
    bare = problem.constrained(effects, Constraints(held))
    theta = np.concatenate([base.theta, np.zeros(count)])
    state = bare.evaluate(theta, base.shot_parameters, base.spread)
    if not np.isfinite(state.cost):
        return bare, state
    H, _ = equations(bare, state)
    scale = float(np.trace(H[-count:, -count:])) / count
    differences = np.diff(np.eye(count), n=2, axis=0)
    rows = np.vstack([np.sqrt(smoothness * scale) * differences, np.sqrt(RIDGE * scale) * np.eye(count)])
    weighed = Constraints(held, (Roughness(identifier, form.coefficients, rows),))
    return problem.constrained(effects, weighed), state


def equations(problem: Problem, state: FitState) -> tuple[Samples, Samples]:
    """Information and gradient of the shared coordinates, each shot's own eliminated."""
    J, Jl = problem.linearise(state)
    H, g, _ = normal_equations(problem, J, Jl, state)
    return H, g


def fit_free_term(
    problem: Problem, base: Fit, form: FreeForm, span: Visited, smoothness: float
) -> tuple[Problem, Fit]:
    """Fit a model with one free-form term more, from where it stands without."""
    extended, state = _start(problem, base, form, span, smoothness)
    fitted = fit(extended, state.theta, state.shot_parameters, spread=base.spread, most_steps=MOST_STEPS)
    return extended, fitted
