"""A fitted model linearised shot by shot, and the score of any direction in which it could be changed.

Every shot's own numbers are projected out of everything first, then the shared parameters; what is left of a
direction is what the fitted model cannot do. Each shot has one row more than samples, its friction factor
over the factors' spread, so that effects between shots are directions like any other.
"""

from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.model.least_squares import Fit
from impactcell.discrepancy.model.problem import Problem
from impactcell.records import Samples

UNSEEN_SHARE = 1e-8
"""A direction of which less than this share is left after projection cannot be seen in these data."""


@dataclass(frozen=True, slots=True, eq=False)
class LinearisedFit:
    """Projected residuals and shared derivatives.

    Attributes
    ----------
    bounds : ndarray, shape (n + 1,)
    residual : ndarray, shape (N,)
    prior_residual : ndarray, shape (n,)
        The row of each shot's friction factor.
    basis : ndarray, shape (q, N)
        Orthonormal, shot by shot, with `prior_basis`, shape (q, n).
    shared, prior_shared : ndarray, shapes (p, N) and (p, n)
    information : ndarray, shape (p, p)
    """

    bounds: np.ndarray
    residual: Samples
    prior_residual: Samples
    basis: Samples
    prior_basis: Samples
    shared: Samples
    prior_shared: Samples
    information: Samples
    shot_information: Samples
    shot_gradient: Samples


@dataclass(frozen=True, slots=True, eq=False)
class Scores:
    """Scores of Q directions.

    Attributes
    ----------
    each : ndarray, shape (n, Q)
        Contribution of every shot to the effective score.
    leverage : ndarray, shape (n, Q, p)
        How a contribution moves with the shared parameters: needed to refit them under resampling.
    information : ndarray, shape (Q,)
        Squared length of what is left of the direction; 0 where it cannot be seen.
    """

    each: Samples
    leverage: Samples
    information: Samples

    @property
    def gain(self) -> Samples:
        """Drop of the squared misfit if the direction were free, to first order, shape (Q,)."""
        seen = self.information > 0.0
        return np.where(seen, self.each.sum(0) ** 2 / np.where(seen, self.information, 1.0), 0.0)

    @property
    def amplitude(self) -> Samples:
        """Step along each direction that lowers the misfit most, shape (Q,)."""
        seen = self.information > 0.0
        return np.where(seen, self.each.sum(0) / np.where(seen, self.information, 1.0), 0.0)


def linearise(problem: Problem, fit: Fit) -> LinearisedFit:
    """Linearise about a fit."""
    bounds = problem.shots.bounds
    model, state = problem.with_effects(fit.effects), fit.state
    shot_jacobian = model.shot_jacobian(state, central=True)
    prior = np.zeros((len(shot_jacobian), problem.count))
    prior[0] = 1.0 / fit.spread
    basis: list[Samples] = []
    prior_basis: list[Samples] = []
    for row, below in zip(shot_jacobian, prior, strict=True):
        v, pv = row.copy(), below.copy()
        size = np.sqrt(_shot_products(v, v, bounds) + pv * pv)
        for _ in range(2):
            for b, pb in zip(basis, prior_basis, strict=True):
                along = _shot_products(v, b, bounds) + pv * pb
                v -= np.repeat(along, np.diff(bounds)) * b
                pv -= along * pb
        length = np.sqrt(_shot_products(v, v, bounds) + pv * pv)
        scale = np.where(
            length > UNSEEN_SHARE * np.maximum(size, 1e-300), 1.0 / np.maximum(length, 1e-300), 0.0
        )
        basis.append(v * np.repeat(scale, np.diff(bounds)))
        prior_basis.append(pv * scale)
    B, PB = np.array(basis), np.array(prior_basis)
    shared = model.shared_jacobian(state)
    J, PJ = _project(shared, np.zeros((len(shared), problem.count)), B, PB, bounds)
    r, pr = _project(fit.residual[None], (-fit.shot_parameters.log_factor / fit.spread)[None], B, PB, bounds)
    p = len(J)
    H = np.empty((problem.count, p, p))
    u = np.empty((problem.count, p))
    for i in range(problem.count):
        part = problem.shots.samples_of(i)
        H[i] = J[:, part] @ J[:, part].T + np.outer(PJ[:, i], PJ[:, i])
        u[i] = J[:, part] @ r[0, part] + PJ[:, i] * pr[0, i]
    return LinearisedFit(bounds, r[0], pr[0], B, PB, J, PJ, H.sum(0), H, u)


def unmet_gradient(problem: Problem, fit: Fit, linearisation: LinearisedFit) -> Samples:
    """Return minus half the cost's gradient where a fit has come to rest, shape (p,); 0 at an optimum.

    At a bound it is 0, too, where the cost falls only beyond it.
    """
    model = problem.with_effects(fit.effects)
    gradient = linearisation.shot_gradient.sum(0) - model.penalty_matrix @ fit.theta
    lower, upper = model.bounds()
    held = ((fit.theta <= lower) & (gradient < 0.0)) | ((fit.theta >= upper) & (gradient > 0.0))
    return np.where(held, 0.0, gradient)


def _shot_products(a: Samples, b: Samples, bounds: np.ndarray) -> Samples:
    sums: Samples = np.add.reduceat(a * b, bounds[:-1])
    return sums


def _project(
    rows: Samples, prior: Samples, basis: Samples, prior_basis: Samples, bounds: np.ndarray
) -> tuple[Samples, Samples]:
    rows, prior = rows.copy(), prior.copy()
    sizes = np.diff(bounds)
    for i in range(len(rows)):
        for b, pb in zip(basis, prior_basis, strict=True):
            along = _shot_products(rows[i], b, bounds) + prior[i] * pb
            rows[i] -= np.repeat(along, sizes) * b
            prior[i] -= along * pb
    return rows, prior


@dataclass(frozen=True, slots=True, eq=False)
class DirectionProducts:
    """What a set of Q directions has in common with residuals and shared derivatives, shot by shot.

    Attributes
    ----------
    residual : ndarray, shape (n, Q)
    shared : ndarray, shape (n, Q, p)
    square, whole : ndarray, shape (n, Q)
        Squared length after and before the shot's own numbers are projected out.
    """

    residual: Samples
    shared: Samples
    square: Samples
    whole: Samples

    def modulate(self, factor: Samples) -> "DirectionProducts":
        """Return the directions scaled by a factor of each shot, shape (n,)."""
        column = factor[:, None]
        return DirectionProducts(
            self.residual * column,
            self.shared * column[:, None],
            self.square * column**2,
            self.whole * column**2,
        )

    def select(self, columns: np.ndarray) -> "DirectionProducts":
        """Return some of the directions."""
        return DirectionProducts(
            self.residual[:, columns],
            self.shared[:, columns],
            self.square[:, columns],
            self.whole[:, columns],
        )


def direction_products(
    linearisation: LinearisedFit, direction: Samples, prior: Samples | None = None
) -> DirectionProducts:
    """Products of one direction.

    Parameters
    ----------
    linearisation : LinearisedFit
    direction : ndarray, shape (N,)
        Change of the whitened prediction.
    prior : ndarray, shape (n,), optional
        Change of the factors' rows.
    """
    n = len(linearisation.bounds) - 1
    below = np.zeros(n) if prior is None else prior
    whole = _shot_products(direction, direction, linearisation.bounds) + below**2
    rows, priors = _project(
        direction[None], below[None], linearisation.basis, linearisation.prior_basis, linearisation.bounds
    )
    d, below = rows[0], priors[0]
    residual = (
        _shot_products(d, linearisation.residual, linearisation.bounds) + below * linearisation.prior_residual
    )
    shared = (
        np.add.reduceat(d * linearisation.shared, linearisation.bounds[:-1], axis=1)
        + below * linearisation.prior_shared
    )
    square = _shot_products(d, d, linearisation.bounds) + below**2
    return DirectionProducts(residual[:, None], shared.T[:, None, :], square[:, None], whole[:, None])


def concatenate_products(parts: list[DirectionProducts]) -> DirectionProducts:
    """Put directions side by side."""
    return DirectionProducts(
        np.concatenate([part.residual for part in parts], axis=1),
        np.concatenate([part.shared for part in parts], axis=1),
        np.concatenate([part.square for part in parts], axis=1),
        np.concatenate([part.whole for part in parts], axis=1),
    )


def scores(linearisation: LinearisedFit, products: DirectionProducts) -> Scores:
    """Effective scores: the shared parameters projected out of the directions."""
    inverse = np.linalg.pinv(linearisation.information, rcond=1e-13, hermitian=True)
    summed = products.shared.sum(0)
    weights = summed @ inverse
    information = products.square.sum(0) - np.einsum("qa,qa->q", summed, weights)
    seen = information > UNSEEN_SHARE * products.whole.sum(0)
    per_shot = products.residual - linearisation.shot_gradient @ weights.T
    lever = products.shared - np.einsum("iab,qb->iqa", linearisation.shot_information, weights)
    return Scores(per_shot * seen, lever * seen[None, :, None], np.where(seen, information, 0.0))
