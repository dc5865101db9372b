"""Where fits of a model with a free-form term begin, whatever its roughness weighs."""

from dataclasses import dataclass, replace

import numpy as np

from impactcell.discrepancy.laws.covariates import Visited
from impactcell.discrepancy.model import (
    Constraints,
    Fit,
    FitState,
    Problem,
    Roughness,
    Support,
    fit,
    normal_equations,
)
from impactcell.physics.bspline import spline_support
from impactcell.physics.free_form import ACROSS, FreeForm
from impactcell.physics.free_forms import LOWER, UPPER
from impactcell.physics.free_pair_forms import SECOND_LOWER, SECOND_UPPER
from impactcell.records import Samples

RIDGE = 1e-9
"""Weight, over what the data know, of the size of the term: what they cannot see of it stays at zero."""
MOST_STEPS = 9
"""Gauss-Newton steps of a free-form fit."""


@dataclass(frozen=True, slots=True, eq=False)
class TermStart:
    """A model with a free-form term that is still at zero: where fits begin, whatever the roughness weighs.

    Attributes
    ----------
    form : FreeForm
    visited : Visited
    problem : Problem
        Nothing is said of the term's roughness.
    state : FitState
    information, gradient : ndarray, shapes (p, p) and (p,)
        Of the shared coordinates, each shot's own eliminated.
    """

    form: FreeForm
    visited: Visited
    problem: Problem
    state: FitState
    information: Samples
    gradient: Samples

    @classmethod
    def at(cls, problem: Problem, base: Fit, form: FreeForm, span: Visited) -> "TermStart":
        """Add a term to a model; a term that is there already keeps its roughness."""
        identifier, count = form.effect.identifier, len(form.coefficients)
        held = {
            **problem.constraints.held,
            f"{identifier}.{LOWER}": span.lower,
            f"{identifier}.{UPPER}": span.upper,
        }
        if span.second is not None:
            held[f"{identifier}.{SECOND_LOWER}"] = span.second.lower
            held[f"{identifier}.{SECOND_UPPER}"] = span.second.upper
        given = problem.constraints
        constraints = Constraints(held, given.roughness, (*given.supports, *_supports(form, span)))
        bare = problem.constrained((*base.effects, identifier), constraints)
        theta = np.concatenate([base.theta, np.zeros(count)])
        state = bare.evaluate(theta, base.shot_parameters, base.spread)
        return cls(form, span, bare, state, *equations(bare, state))

    @property
    def has_answer(self) -> bool:
        """Whether the plant has one, and derivatives."""
        return bool(np.isfinite(self.information).all() and np.isfinite(self.gradient).all())

    def weighed(self, smoothness: float) -> Problem:
        """Weigh the roughness by what the data know of the coefficients."""
        if not np.isfinite(self.state.cost):
            return self.problem
        identifier, count = self.form.effect.identifier, len(self.form.coefficients)
        scale = float(np.trace(self.information[-count:, -count:])) / count
        differences = _second_differences(self.form)
        rows = np.vstack([np.sqrt(smoothness * scale) * differences, np.sqrt(RIDGE * scale) * np.eye(count)])
        given = self.problem.constraints
        roughness = (*given.roughness, Roughness(identifier, self.form.coefficients, rows))
        constraints = replace(given, roughness=roughness)
        return self.problem.constrained(self.problem.effects, constraints)

    def fit(self, smoothness: float) -> tuple[Problem, Fit]:
        """Fit the model, by a few steps."""
        extended, state = self.weighed(smoothness), self.state
        fitted = fit(extended, state.theta, state.shot_parameters, spread=state.spread, most_steps=MOST_STEPS)
        return extended, fitted


def _supports(form: FreeForm, span: Visited) -> tuple[Support, ...]:
    """Where a term's coefficients act, if that is a matter of the position on the table."""
    if form.covariate != "position" or form.is_between_shots:
        return ()
    begin, end = spline_support(span.lower, span.upper, form.spans)
    rows = ACROSS if form.second else 1
    return (Support(form.effect.identifier, form.coefficients, np.tile(begin, rows), np.tile(end, rows)),)


def _second_differences(form: FreeForm) -> Samples:
    """Second differences of a term's coefficients, along either covariate; they are nought of a plane."""
    count = len(form.coefficients)
    if not form.second:
        return np.diff(np.eye(count), n=2, axis=0)
    along, across = np.eye(count // ACROSS), np.eye(ACROSS)
    return np.vstack(
        [np.kron(across, np.diff(along, n=2, axis=0)), np.kron(np.diff(across, n=2, axis=0), along)]
    )


def equations(problem: Problem, state: FitState) -> tuple[Samples, Samples]:
    """Information and gradient of the shared coordinates, each shot's own eliminated."""
    J, Jl = problem.linearise(state)
    H, g, _ = normal_equations(problem, J, Jl, state)
    return H, g


def fit_free_term(
    problem: Problem, base: Fit, form: FreeForm, span: Visited, smoothness: float
) -> tuple[Problem, Fit]:
    """Fit a model with one free-form term more, from where it stands without."""
    return TermStart.at(problem, base, form, span).fit(smoothness)
