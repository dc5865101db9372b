"""Which fitted models the shots do not tell apart: out-of-shot likelihoods, shot by shot (Vuong 1989).

What a model says of a shot is judged by parameters to which that shot and its replicates did not contribute,
so that an effect with more parameters has no advantage. The parameters without them are one Gauss-Newton step
away from those with them, and what a fit has come to rest short of its optimum is no part of that step.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import f as fisher

from impactcell.discrepancy.data import IndexArray
from impactcell.discrepancy.model import Fit, Problem, linearise, unmet_gradient
from impactcell.discrepancy.search.policy import POLICY
from impactcell.records import Samples

MAX_DEVIATION = 2.2
"""Standard deviations of the difference up to which two models are not told apart: two-sided 3 %."""
NEGLIGIBLE_DIFFERENCE = 2.0
"""Log-likelihood that tells nothing apart, however sure it is."""
DECISIVE_DIFFERENCE = 150.0
"""Log-likelihood, over the best model's mean squared residual, beyond which a few shots alone decide."""
MAX_FOLD_SHARE = 0.25
"""A group of replicates that holds more of the shots is left out shot by shot."""


MAX_LEVERAGE = 0.98
"""Largest leverage of a fold: beyond it a step away from the fit is no longer a matter of derivatives."""
UNSEEN_INFORMATION = 1e-10
"""Share of the largest information, scaled to a unit diagonal, below which a direction is not seen."""


@dataclass(frozen=True, slots=True, eq=False)
class CandidateFit:
    """A fitted model with its log-likelihood of every shot out of shot, shape (n,)."""

    fit: Fit
    each: Samples


@dataclass(frozen=True, slots=True, eq=False)
class Alternative:
    """A set of effects that was fitted, and how much less likely it is out of shot than the best."""

    fit: Fit
    log_likelihood: float
    deficit: float
    deficit_std: float

    @property
    def effects(self) -> tuple[str, ...]:
        """Its effects."""
        return self.fit.effects


def folds(problem: Problem) -> IndexArray:
    """Fold of every shot: its replicate group, or itself where a group holds many of the shots."""
    group = np.array([shot.group for shot in problem.shots.items])
    _, member, size = np.unique(group, return_inverse=True, return_counts=True)
    large = size[member] > MAX_FOLD_SHARE * problem.count
    return np.where(large, problem.count + np.arange(problem.count), member)


def evaluate_out_of_shot(problem: Problem, model: Fit) -> CandidateFit:
    """Log-likelihood of every shot under parameters fitted without its fold.

    With u and H the gradient and information of a fold, and u_0 and H_0 those of all shots, the parameters
    without it lie at -s = (H_0 - H)^-1 (u_0 - u), where the fold's misfit is larger by 2 u's + s'H s. At an
    optimum u_0 is zero; short of it, where one fold tells nearly all of a direction, u_0 must not be taken
    for what the others say. What only one fold tells has no such parameters: its leverage is held below one.
    """
    linearisation = linearise(problem, model)
    scale = np.sqrt(np.maximum(np.diag(linearisation.information), 1e-300))
    H = linearisation.shot_information / np.outer(scale, scale)
    u = linearisation.shot_gradient / scale
    unmet = unmet_gradient(problem, model, linearisation) / scale
    log_likelihood = model.log_likelihood(problem.shots)
    fold = folds(problem)
    whitener = _whitener(H.sum(0))
    for number in np.unique(fold):
        in_fold = fold == number
        leverage, axes = np.linalg.eigh(whitener.T @ H[in_fold].sum(0) @ whitener)
        axes = whitener @ axes
        step = axes @ ((axes.T @ (u[in_fold].sum(0) - unmet)) / (1.0 - np.minimum(leverage, MAX_LEVERAGE)))
        log_likelihood[in_fold] -= u[in_fold] @ step + 0.5 * np.einsum("a,iab,b->i", step, H[in_fold], step)
    return CandidateFit(model, log_likelihood)


def _whitener(information: Samples) -> Samples:
    """Columns w with w' H w = 1, in the directions that the shots see at all, shape (p, r)."""
    values, vectors = np.linalg.eigh(information)
    seen = values > UNSEEN_INFORMATION * max(float(values.max(initial=0.0)), 1e-300)
    whitener: Samples = vectors[:, seen] / np.sqrt(values[seen])
    return whitener


def rank_out_of_shot(problem: Problem, fits: Iterable[Fit]) -> list[CandidateFit]:
    """Sort fits by their likelihood out of shot, the likeliest first."""
    candidates = [evaluate_out_of_shot(problem, candidate) for candidate in fits]
    return sorted(candidates, key=lambda candidate: (-float(candidate.each.sum()), candidate.fit.effects))


def are_indistinguishable(problem: Problem, best: CandidateFit, other: CandidateFit) -> bool:
    """Whether the shots do not tell two models apart."""
    difference = best.each - other.each
    gap, std = float(difference.sum()), float(difference.std() * np.sqrt(len(difference)))
    dispersion = max(float(best.fit.misfit(problem.shots).mean() / problem.sizes.mean()), 1.0)
    return gap < NEGLIGIBLE_DIFFERENCE or (
        gap <= MAX_DEVIATION * std and gap < DECISIVE_DIFFERENCE * dispersion
    )


def widest_rival(spread: float, shots: int) -> float:
    """Spread of the factors up to which a rival is not told from a model that leaves `spread`."""
    limit: float = spread * float(fisher.ppf(POLICY.rival_probability, shots, shots)) ** 0.5
    return limit


def total_log_likelihood(problem: Problem, model: Fit) -> float:
    """Log-likelihood over all shots."""
    return float(model.log_likelihood(problem.shots).sum())


def sort_by_likelihood(problem: Problem, fits: Iterable[Fit]) -> list[Fit]:
    """Sort fits, the likeliest first."""
    return sorted(fits, key=lambda model: (-total_log_likelihood(problem, model), model.effects))


def compare_fits(candidates: Sequence[CandidateFit]) -> tuple[Alternative, ...]:
    """Compare models with the likeliest of them, the likeliest first."""
    compared = []
    best = max(candidates, key=lambda candidate: float(candidate.each.sum()), default=None)
    for candidate in candidates:
        if best is not None:
            difference = best.each - candidate.each
            std = float(difference.std() * np.sqrt(len(difference)))
            compared.append(
                Alternative(candidate.fit, float(candidate.each.sum()), float(difference.sum()), std)
            )
    return tuple(sorted(compared, key=lambda candidate: -candidate.log_likelihood))
