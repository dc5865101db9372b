"""Which fitted models the shots do not tell apart: out-of-shot likelihoods, shot by shot (Vuong 1989).

What a model says of a shot is judged by parameters to which that shot and its replicates did not contribute,
so that an effect with more parameters has no advantage. The parameters without them are one Gauss-Newton step
away from those with them, and what a fit has come to rest short of its optimum is no part of that step.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
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
    return folds_of_groups(np.array([shot.group for shot in problem.shots.items]))


def folds_of_groups(group: IndexArray) -> IndexArray:
    """Fold of every shot, shape (n,), by the replicate groups; one that holds many of the shots is none."""
    count = len(group)
    _, member, size = np.unique(group, return_inverse=True, return_counts=True)
    large = size[member] > MAX_FOLD_SHARE * count
    return np.where(large, count + np.arange(count), member)


def evaluate_out_of_shot(problem: Problem, model: Fit) -> CandidateFit:
    """Log-likelihood of every shot under parameters fitted without its fold."""
    linearisation = linearise(problem, model)
    unmet = unmet_gradient(problem, model, linearisation)
    loss = out_of_shot_loss(
        linearisation.shot_information, linearisation.shot_gradient, folds(problem), unmet
    )
    return CandidateFit(model, model.log_likelihood(problem.shots) - loss)


def out_of_shot_loss(H: Samples, u: Samples, fold: IndexArray, unmet: Samples) -> Samples:
    """Log-likelihood that every shot loses by parameters fitted without its fold, shape (..., n).

    With u and H the gradient and information of a fold, and u_0 and H_0 those of all shots, the parameters
    without it lie at -s = (H_0 - H)^-1 (u_0 - u), where the fold's misfit is larger by 2 u's + s'H s. At an
    optimum u_0 is zero; short of it, where one fold tells nearly all of a direction, u_0 must not be taken
    for what the others say. What only one fold tells has no such parameters: its leverage is held below one.

    Parameters
    ----------
    H, u : ndarray, shapes (n, p, p) and (..., n, p)
        Information and gradient of every shot; gradients may be those of several draws of the same shots.
    fold : ndarray, shape (n,)
    unmet : ndarray, shape (p,)
        u_0, where a fit has come to rest short of its optimum.
    """
    scale = np.sqrt(np.maximum(np.diag(H.sum(0)), 1e-300))
    whitener = _whitener(H.sum(0) / np.outer(scale, scale)) / scale[:, None]
    H, u = whitener.T @ H @ whitener, u @ whitener
    numbers, member = np.unique(fold, return_inverse=True)
    of_fold = np.zeros((len(numbers), len(fold)))
    of_fold[member, np.arange(len(fold))] = 1.0
    leverage, axes = np.linalg.eigh(np.tensordot(of_fold, H, 1))
    along = each_times(of_fold @ u - unmet @ whitener, axes)
    along = along / (1.0 - np.minimum(leverage, MAX_LEVERAGE))
    step = each_times(along, np.swapaxes(axes, 1, 2))[..., member, :]
    loss: Samples = ((u + 0.5 * each_times(step, H)) * step).sum(-1)
    return loss


def each_times(rows: Samples, matrices: Samples) -> Samples:
    """Rows, shape (..., n, p), each times its matrix, shape (n, p, r)."""
    first = np.moveaxis(rows, -2, 0)
    product = first.reshape(len(matrices), -1, rows.shape[-1]) @ matrices
    return np.moveaxis(product.reshape(*first.shape[:-1], matrices.shape[-1]), 0, -2)


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
    dispersion = max(float(best.fit.misfit(problem.shots).mean() / problem.sizes.mean()), 1.0)
    return not bool(are_apart(best.each - other.each, dispersion))


def are_apart(difference: Samples, dispersion: float) -> NDArray[np.bool_]:
    """Whether models are told apart by what shots say of them, shape (...,) of differences (..., n).

    Parameters
    ----------
    difference : ndarray, shape (..., n)
        Log-likelihood of every shot out of shot under the likelier model less that under the other one.
    dispersion : float
        Mean squared residual of the likelier one, at least 1.
    """
    gap, std = difference.sum(-1), difference.std(-1) * np.sqrt(difference.shape[-1])
    is_sure = (gap > MAX_DEVIATION * std) | (gap >= DECISIVE_DIFFERENCE * dispersion)
    apart: NDArray[np.bool_] = (gap >= NEGLIGIBLE_DIFFERENCE) & is_sure
    return apart


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
