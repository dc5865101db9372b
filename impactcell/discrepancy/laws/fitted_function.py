"""A fitted free-form term as a function: its values with their band, and what it takes of energy."""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaincinv

from impactcell.discrepancy.laws.free_term import FreeTerm
from impactcell.discrepancy.laws.refit import FittedLaw
from impactcell.discrepancy.laws.term_start import equations
from impactcell.discrepancy.model import parameter_name
from impactcell.records import Samples

DRAWN, DRAWN_PER_COEFFICIENT = 60, 5
"""Points of the range at which a term is looked at; and at which it is drawn, if those are more, of each
coefficient of its spline."""
BAND = 1.96
"""Standard deviations of a 95 % band."""
CONFIDENCE = 0.95
"""Of the band that the energy given by a dissipative term has to leave."""
DIFFERENCE_STEP = 1e-5
"""Step of a coordinate, most of them logarithms or in units of their own scale, for a slope [1]."""
SLICES = (0.1, 0.5, 0.9)
"""Quantiles of a second covariate at which a term of two is drawn."""
UNSEEN = 1e-13
"""Share of the largest information below which a direction is not seen: rounding."""
LOOKED_AT = 2000
"""Visited states, about, at which a term is held against the energy that it takes."""


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
    covariance = _inverse(H + term.problem.penalty_matrix)
    scale = np.array([term.fit.coordinates[i].scale for i in term.columns.tolist()])
    inside = covariance[np.ix_(term.columns, term.columns)] * np.outer(scale, scale)
    std = np.sqrt(np.maximum(np.einsum("nk,kl,nl->n", basis, inside, basis), 0.0))
    return basis @ term.coefficients, std


def _inverse(information: Samples) -> Samples:
    """Invert what is seen of an information; rounding may make the rest of it negative."""
    sizes, directions = np.linalg.eigh(information)
    seen = sizes > UNSEEN * sizes[-1]
    inverse: Samples = (directions[:, seen] / sizes[seen]) @ directions[:, seen].T
    return inverse


def effective_numbers(term: FreeTerm) -> float:
    """Effective number of coefficients of penalised splines, tr((H + P)⁻¹ H) over them (Wood 2017).

    Those of the term, and of any other that the model has.
    """
    H, _ = equations(term.problem, term.fit.state)
    penalty = term.problem.penalty_matrix
    share = _inverse(H + penalty) @ H
    return float(np.diag(share)[np.diag(penalty) > 0.0].sum())


def gives_energy(term: FreeTerm, law: FittedLaw | None = None) -> bool:
    """Whether a dissipative term, or its law, gives more energy than the uncertainty of its fit.

    With s the sum of the function and the plant's own beside it, and P what multiplies it in power,
    E = sum P s over those visited states at which s is negative. To first order E moves with the coordinates
    of the fit by J, so that its standard deviation is sqrt(J' C J), C the inverse of the information: errors
    along the path go together as the fit says that they do. Few fits come to rest, so E is taken one
    Gauss-Newton step farther. The same data choose the states, so that the band is Scheffe's (1953), which
    holds for all sums at once: the square root of the 95 % quantile of chi-squared of as many degrees of
    freedom as the function has numbers.
    """
    if not term.form.dissipates or term.visited.power is None:
        return False
    every = max(len(term.visited.points) // LOOKED_AT, 1)
    points, power = term.visited.points[::every], term.visited.power[::every]
    model: FreeTerm | FittedLaw = term if law is None else law
    identifier = term.form.effect.identifier if law is None else law.law.identifier
    theta = model.fit.theta
    values = _sum_with_own(term, model, points, theta)
    given = np.where(values < 0.0, power, 0.0)
    energy = float(given @ values)
    places = [
        place
        for place, coordinate in enumerate(model.fit.coordinates)
        if coordinate.effect == identifier or parameter_name(coordinate) == term.form.dissipates
    ]
    slopes = np.zeros(theta.size)
    for place in places:
        moved = theta.copy()
        moved[place] += DIFFERENCE_STEP
        change = _sum_with_own(term, model, points, moved) - values
        slopes[place] = float(given @ change) / DIFFERENCE_STEP
    H, gradient = equations(model.problem, model.fit.state)
    penalty = model.problem.penalty_matrix
    covariance = _inverse(H + penalty)
    energy += float(slopes @ covariance @ (gradient - penalty @ theta))
    std = math.sqrt(float(slopes @ covariance @ slopes))
    numbers = effective_numbers(term) if law is None else float(len(places))
    return energy < -math.sqrt(2.0 * float(gammaincinv(0.5 * numbers, CONFIDENCE))) * std


def _sum_with_own(term: FreeTerm, model: FreeTerm | FittedLaw, points: Samples, theta: Samples) -> Samples:
    """Sum of a dissipative function and the plant's own at some coordinates of the fit, shape (n,)."""
    moved = replace(model, fit=replace(model.fit, theta=theta))
    if isinstance(moved, FreeTerm):
        values: Samples = moved.basis(points) @ moved.coefficients
    else:
        values = moved.function(points)
    for coordinate, number in zip(moved.fit.coordinates, theta.tolist(), strict=True):
        if parameter_name(coordinate) == term.form.dissipates:
            values = values + coordinate.value(number)
    return values
