"""A fitted model linearised shot by shot, and the score of any direction in which it could be changed.

Every shot's own numbers are projected out of everything first, then the shared parameters; what is left of a
direction is what the fitted model cannot do. Each shot has one row more than samples, its friction factor
over the factors' spread, so that effects between shots are directions like any other. A velocity or a mass
that is open is projected out as if nothing were told of it: what all shots have wrong alike would count n
times.
"""

from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.model.least_squares import Fit
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.model.shot_fits import gram_of_shots
from impactcell.records import Samples

UNSEEN_SHARE = 1e-8
"""A direction of which less than this share is left after projection cannot be seen in these data."""


@dataclass(frozen=True, slots=True, eq=False)
class LinearisedFit:
    """Residuals and shared derivatives, each shot's own numbers projected out of them.

    Attributes
    ----------
    bounds : ndarray, shape (n + 1,)
    rows, prior_rows : ndarray, shapes (q + 1 + p, N) and (q + 1 + p, n)
        Orthonormal basis of what the shots' own numbers can do, residual, and derivatives by the shared
        coordinates; samples, and the row of each shot's friction factor.
    own : int
        q, how many numbers a shot has of its own.
    information : ndarray, shape (p, p)
    """

    bounds: np.ndarray
    rows: Samples
    prior_rows: Samples
    own: int
    information: Samples
    shot_information: Samples
    shot_gradient: Samples

    @property
    def mean_squared_residual(self) -> float:
        """Of all samples, the shots' own numbers projected out; 1 where noise is all that is left."""
        return float(np.mean(self.rows[self.own] ** 2))


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
    shared = model.shared_jacobian(state)
    rows, priors = _project(
        np.vstack([fit.residual, shared]),
        np.vstack([-fit.shot_parameters.log_factor / fit.spread, np.zeros((len(shared), problem.count))]),
        (basis, prior_basis),
        bounds,
    )
    products = gram_of_shots(rows, bounds) + np.einsum("ai,bi->iab", priors, priors)
    H, u = products[:, 1:, 1:], products[:, 1:, 0]
    return LinearisedFit(
        bounds, np.vstack([*basis, rows]), np.vstack([*prior_basis, priors]), len(basis), H.sum(0), H, u
    )


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
    rows: Samples, prior: Samples, basis: tuple[list[Samples], list[Samples]], bounds: np.ndarray
) -> tuple[Samples, Samples]:
    sizes = np.diff(bounds)
    for i in range(len(rows)):
        for b, pb in zip(*basis, strict=True):
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
    bounds, own = linearisation.bounds, linearisation.own
    below = np.zeros(len(bounds) - 1) if prior is None else prior
    parts = zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True)
    along = np.array([linearisation.rows[:, i:j] @ direction[i:j] for i, j in parts])
    along += (linearisation.prior_rows * below).T
    whole = _shot_products(direction, direction, bounds) + below**2
    # Residual and derivatives are at right angles to the basis: only the length has a part in it to lose.
    square = whole - (along[:, :own] ** 2).sum(1)
    return DirectionProducts(along[:, own, None], along[:, None, own + 1 :], square[:, None], whole[:, None])


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
