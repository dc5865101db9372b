"""Which fitted models the shots do not tell apart: out-of-shot likelihoods, shot by shot (Vuong 1989).

What a model says of a shot is judged by parameters to which that shot and its replicates did not contribute,
so that an effect with more parameters has no advantage. The parameters without them are one Gauss-Newton step
away from those with them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.data.shots import Index
from impactcell.discrepancy.model.fit import Fit
from impactcell.discrepancy.model.linearisation import linearise
from impactcell.discrepancy.model.problem import Problem
from impactcell.records import Samples

TIED = 2.2
ALIKE = 2.0
DECISIVE = 150.0
"""Log-likelihood, over the best model's mean squared residual, beyond which a few shots alone decide."""
LARGEST_FOLD = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Contender:
    """A fitted model with its log-likelihood of every shot out of shot, shape (n,)."""

    fit: Fit
    each: Samples


@dataclass(frozen=True, slots=True, eq=False)
class Alternative:
    """A set of effects that was fitted, and how much less likely it is out of shot than the best."""

    fit: Fit
    log_likelihood: float
    behind: float
    behind_std: float

    @property
    def effects(self) -> tuple[str, ...]:
        """Its effects."""
        return self.fit.effects


def folds(problem: Problem) -> Index:
    """Fold of every shot: its replicate group, or itself where a group holds many of the shots."""
    group = np.array([shot.group for shot in problem.shots.items])
    _, member, size = np.unique(group, return_inverse=True, return_counts=True)
    large = size[member] > LARGEST_FOLD * problem.count
    return np.where(large, problem.count + np.arange(problem.count), member)


def out_of_shot(problem: Problem, model: Fit) -> Contender:
    """Log-likelihood of every shot under parameters fitted without its fold.

    With u and H the gradient and information of a fold and H_0 those of all shots, the parameters without it
    lie at -(H_0 - H)^-1 u, where the fold's misfit is larger by 2 u's + s'H s with s = (H_0 - H)^-1 u.
    """
    tangent = linearise(problem, model)
    scale = np.sqrt(np.maximum(np.diag(tangent.information), 1e-300))
    H = tangent.shot_information / np.outer(scale, scale)
    u = tangent.shot_gradient / scale
    each = model.log_likelihood(problem.shots)
    fold = folds(problem)
    for number in np.unique(fold):
        mine = fold == number
        step = np.linalg.pinv(H[~mine].sum(0), rcond=1e-10, hermitian=True) @ u[mine].sum(0)
        each[mine] -= u[mine] @ step + 0.5 * np.einsum("a,iab,b->i", step, H[mine], step)
    return Contender(model, each)


def ranked(problem: Problem, fits: Iterable[Fit]) -> list[Contender]:
    """Sort fits by their likelihood out of shot, the likeliest first."""
    made = [out_of_shot(problem, one) for one in fits]
    return sorted(made, key=lambda one: (-float(one.each.sum()), one.fit.effects))


def is_tied(problem: Problem, best: Contender, other: Contender) -> bool:
    """Whether the shots do not tell two models apart."""
    difference = best.each - other.each
    gap, std = float(difference.sum()), float(difference.std() * np.sqrt(len(difference)))
    dispersion = max(float(best.fit.misfit(problem.shots).mean() / problem.sizes.mean()), 1.0)
    return gap < ALIKE or (gap <= TIED * std and gap < DECISIVE * dispersion)


def total(problem: Problem, made: Fit) -> float:
    """Log-likelihood over all shots."""
    return float(made.log_likelihood(problem.shots).sum())


def by_likelihood(problem: Problem, fits: Iterable[Fit]) -> list[Fit]:
    """Sort fits, the likeliest first."""
    return sorted(fits, key=lambda made: (-total(problem, made), made.effects))


def alternatives(contenders: Sequence[Contender]) -> tuple[Alternative, ...]:
    """Compare models with the likeliest of them, the likeliest first."""
    made = []
    best = max(contenders, key=lambda one: float(one.each.sum()), default=None)
    for one in contenders:
        if best is not None:
            difference = best.each - one.each
            std = float(difference.std() * np.sqrt(len(difference)))
            made.append(Alternative(one.fit, float(one.each.sum()), float(difference.sum()), std))
    return tuple(sorted(made, key=lambda one: -one.log_likelihood))
