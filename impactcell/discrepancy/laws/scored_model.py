"""A model with a free-form term or a named effect, as likely as every shot finds it for its numbers."""

import math
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.laws.fitted_function import effective_numbers
from impactcell.discrepancy.laws.free_term import FreeTerm
from impactcell.discrepancy.model import Fit, Problem
from impactcell.records import Samples

MIN_GAIN = 30.0
"""Log-likelihood that a name must add to the best term alone [1], as a second effect must to the first."""
TIED_DEVIATIONS, LARGEST_TIE = 2.2, 150.0
"""Standard deviations over shots up to which two models are not told apart [1], and the largest difference
of log-likelihoods that is a tie, over the mean squared residual [1]; as among named effects."""
MOST_LEFT = 1.1
"""RMS residual [noise floors] up to which a model with a term leaves nothing that speaks against it."""


@dataclass(frozen=True, slots=True, eq=False)
class ScoredModel:
    """A model with a free-form term, with a named effect beside it or alone.

    Attributes
    ----------
    effect : str
        Named effect; empty for the term alone.
    place : str
    fit : Fit
    each : ndarray, shape (n,)
        Log-likelihood of every shot, less its part of half the logarithm of the samples for each number
        (Schwarz 1978), those of the spline counted by what its roughness leaves of them.
    p_value : float
        That the term alone lacks nothing, by the test of this effect beside it, over the library.
    numbers : float
        Shared numbers of the model, those of the spline counted likewise.
    """

    effect: str
    place: str
    fit: Fit
    each: Samples
    p_value: float
    numbers: float

    @property
    def variance_of_factors(self) -> float:
        """Variance of the friction factors about their law, for each degree of freedom that is left."""
        shots = len(self.each)
        return self.fit.spread**2 * shots / (shots - self.numbers) if self.numbers < shots else math.inf

    @property
    def score(self) -> float:
        """Over all shots."""
        return float(self.each.sum())

    @property
    def mean_square(self) -> float:
        """Mean squared residual [squared noise floors]."""
        return float(np.mean(self.fit.residual**2))

    def is_told_from(self, other: "ScoredModel") -> bool:
        """Whether the shots tell another model, which is worse, from this one."""
        difference = self.each - other.each
        gap = float(difference.sum())
        scatter = float(difference.std()) * math.sqrt(len(difference))
        return gap > MIN_GAIN and (
            gap > TIED_DEVIATIONS * scatter or gap > LARGEST_TIE * max(self.mean_square, 1.0)
        )

    @property
    def leaves_nothing(self) -> bool:
        """Whether nothing is left that speaks against it."""
        return self.mean_square <= MOST_LEFT**2


def score_term(term: FreeTerm, effect: str, p_value: float) -> ScoredModel:
    """Score a model that has a term, with an effect beside it or alone."""
    penalised = int((np.diag(term.problem.penalty_matrix) > 0.0).sum())
    numbers = len(term.fit.coordinates) - penalised + effective_numbers(term)
    return _scored(term.problem, term.fit, (effect, term.form.place), numbers, p_value)


def score_fit(problem: Problem, fitted: Fit, effect: str, place: str = "") -> ScoredModel:
    """Score a model whose numbers all count."""
    return _scored(problem, fitted, (effect, place), float(len(fitted.coordinates)), 1.0)


def _scored(
    problem: Problem, fitted: Fit, names: tuple[str, str], numbers: float, p_value: float
) -> ScoredModel:
    cost = 0.5 * math.log(fitted.residual.size) * numbers
    each = fitted.log_likelihood(problem.shots) - cost / problem.count
    return ScoredModel(*names, fitted, each, p_value, numbers)
