"""Quadratic log-likelihood of a free-form term's coefficients, near where it was fitted."""

from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.laws.free_term import FreeTerm
from impactcell.discrepancy.laws.term_start import equations
from impactcell.records import Samples


@dataclass(frozen=True, slots=True, eq=False)
class Tangent:
    """Quadratic log-likelihood of the coefficients.

    Attributes
    ----------
    information : ndarray, shape (K, K)
    pull : ndarray, shape (K,)
    lower, upper : float
        Range of the covariate.
    samples : int
        How many were fitted.
    constant : bool
        A constant function is a law of its own.
    fitted : ndarray, shape (K,)
        Coefficients of the fitted spline itself.
    others, response : ndarray, shape (p,) and (p, K)
        All other coordinates at zero coefficients, and how they move with the coefficients.
    second : (float, float) or None
        Range of the second covariate; None where there is one alone.
    """

    information: Samples
    pull: Samples
    lower: float
    upper: float
    samples: int
    constant: bool
    fitted: Samples
    others: Samples
    response: Samples
    second: tuple[float, float] | None = None

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """Range of each covariate."""
        first = (self.lower, self.upper)
        return (first,) if self.second is None else (first, self.second)

    @property
    def references(self) -> tuple[float, ...]:
        """Largest magnitude of each covariate."""
        return tuple(max(map(abs, ends)) for ends in self.ranges)

    @property
    def most(self) -> float:
        """Gain of the spline itself: no form has more."""
        return 0.5 * float(
            self.pull @ np.linalg.pinv(self.information, rcond=1e-10, hermitian=True) @ self.pull
        )


def tangent(term: FreeTerm) -> Tangent:
    """Quadratic log-likelihood of a fitted term's coefficients, in the unit of its place."""
    H, g = equations(term.problem, term.fit.state)
    inside = term.columns
    rest = np.setdiff1d(np.arange(len(g)), inside)
    inverse = np.linalg.pinv(H[np.ix_(rest, rest)], rcond=1e-13, hermitian=True)
    scale = np.array([term.fit.coordinates[i].scale for i in inside.tolist()])
    cross = H[np.ix_(rest, inside)] / scale
    S = H[np.ix_(inside, inside)] / np.outer(scale, scale) - cross.T @ inverse @ cross
    pull = g[inside] / scale - cross.T @ inverse @ g[rest] + S @ term.coefficients
    response = -inverse @ cross
    others = term.fit.theta[rest] + inverse @ g[rest] - response @ term.coefficients
    span, form = term.visited, term.form
    samples = term.fit.residual.size
    second = None if span.second is None else (span.second.lower, span.second.upper)
    return Tangent(
        S, pull, span.lower, span.upper, samples, form.has_constant, term.coefficients, others, response,
        second,
    )  # fmt: skip
