"""A fitted free-form term as a function: its values with their band, and what it takes of energy."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.laws.free_term import FreeTerm
from impactcell.discrepancy.laws.term_start import equations
from impactcell.discrepancy.model import parameter_name
from impactcell.records import Samples

DRAWN, DRAWN_PER_COEFFICIENT = 60, 5
"""Points of the range at which a term is looked at; and at which it is drawn, if those are more, of each
coefficient of its spline."""
BAND = 1.96
"""Standard deviations of a 95 % band."""
BELOW_BAND = 0.025
"""Share of states below a band of 95 % by chance."""
SLICES = (0.1, 0.5, 0.9)
"""Quantiles of a second covariate at which a term of two is drawn."""
LOOKED_AT = 2000
"""Visited states at most at which a term of two covariates is held against the energy that it takes."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedFunction:
    """A fitted function with its 95 % band, each of shape (n,)."""

    covariate: Samples
    function: Samples
    low: Samples
    high: Samples


def fitted_function(term: FreeTerm, quantile: float = 0.5, count: int = DRAWN) -> FittedFunction:
    """Evaluate a term along its covariate, at a quantile of the second one where there are two."""
    u = np.linspace(term.visited.lower, term.visited.upper, count)
    second = term.visited.second
    points = u
    if second is not None:
        points = np.column_stack([u, np.full(count, np.quantile(second.values, quantile))])
    value, std = _with_deviation(term, points)
    return FittedFunction(u, value, value - BAND * std, value + BAND * std)


def drawn_function(term: FreeTerm) -> FittedFunction:
    """Evaluate a term as finely as its spline may bend."""
    return fitted_function(term, count=max(DRAWN, DRAWN_PER_COEFFICIENT * len(term.columns)))


def slices_of(term: FreeTerm) -> tuple[tuple[float, FittedFunction], ...]:
    """Evaluate a term of two covariates at values of the second; none where there is one alone."""
    second = term.visited.second
    if second is None:
        return ()
    levels = [float(np.quantile(second.values, share)) for share in SLICES]
    return tuple((w, fitted_function(term, share)) for w, share in zip(levels, SLICES, strict=True))


def _with_deviation(term: FreeTerm, points: Samples) -> tuple[Samples, Samples]:
    """Values of a term and their standard deviations, each of shape (n,)."""
    basis = term.basis(points)
    H, _ = equations(term.problem, term.fit.state)
    covariance = np.linalg.pinv(H + term.problem.penalty_matrix, rcond=1e-13, hermitian=True)
    scale = np.array([term.fit.coordinates[i].scale for i in term.columns.tolist()])
    inside = covariance[np.ix_(term.columns, term.columns)] * np.outer(scale, scale)
    std = np.sqrt(np.maximum(np.einsum("nk,kl,nl->n", basis, inside, basis), 0.0))
    return basis @ term.coefficients, std


def effective_numbers(term: FreeTerm) -> float:
    """Effective number of coefficients of penalised splines, tr((H + P)⁻¹ H) over them (Wood 2017).

    Those of the term, and of any other that the model has.
    """
    H, _ = equations(term.problem, term.fit.state)
    penalty = term.problem.penalty_matrix
    share = np.linalg.pinv(H + penalty, rcond=1e-13, hermitian=True) @ H
    return float(np.diag(share)[np.diag(penalty) > 0.0].sum())


def gives_energy(term: FreeTerm, function: Callable[[Samples], Samples] | None = None) -> bool:
    """Whether a dissipative term, with the plant's own beside it, is negative beyond its band somewhere.

    Of two covariates: the law where there is one; else the spline at more of the visited states than
    a band of 95 % leaves out by chance.
    """
    if not term.form.dissipates:
        return False
    own = 0.0
    for place, coordinate in enumerate(term.fit.coordinates):
        if parameter_name(coordinate) == term.form.dissipates:
            own = coordinate.value(float(term.fit.theta[place]))
    if term.visited.second is None:
        return bool((own + fitted_function(term).high < 0.0).any())
    points = term.visited.points
    points = points[:: max(len(points) // LOOKED_AT, 1)]
    if function is not None:
        return bool((own + function(points) < 0.0).any())
    value, std = _with_deviation(term, points)
    return float(np.mean(own + value + BAND * std < 0.0)) > BELOW_BAND
