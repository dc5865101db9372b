"""A smooth spline in one place of a machine's model, as smooth as blocks it was not fitted to want it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impactcell.discrepancy.laws import BAND, DRAWN, FittedFunction, Tangent
from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.regression.block_sums import (
    Blocks,
    prior_weight,
    roughness_penalty,
)
from impactcell.discrepancy.machine.regression.weak_form import Column
from impactcell.discrepancy.machine.terms.base_model import NumberPrior
from impactcell.discrepancy.machine.terms.rival_forms import SPLINE_PIECES, splines
from impactcell.records import Samples

SMOOTHNESS = (1e-4, 1e-2, 1.0, 1e2)
"""Weights of the roughness that are tried, over the information that the blocks have of a coefficient [1]."""


@dataclass(frozen=True, slots=True, eq=False)
class FreeSpline:
    """A spline in one place.

    Attributes
    ----------
    form : str
    penalty : ndarray, shape (K, K)
    gains : ndarray, shape (b,)
        Fall of each training block's squared residual out of fold.
    """

    form: str
    penalty: Samples
    gains: Samples

    @property
    def columns(self) -> tuple[Column, ...]:
        """Its columns of the regression."""
        return spline_columns(self.form)


def spline_columns(form: str) -> tuple[Column, ...]:
    """Columns of the regression of the spline in a place."""
    return tuple((form, 0.0, number) for number in range(SPLINE_PIECES + 3))


def best_spline(
    fits: MachineFits, blocks: Blocks, model: FittedModel, before: Samples, form: str
) -> FreeSpline:
    """As smooth as blocks that it was not fitted to want it."""
    trials = []
    for weight in SMOOTHNESS:
        penalty = roughness_penalty(blocks, spline_columns(form), weight)
        losses = np.empty(len(blocks))
        for fold, outside in zip(np.unique(blocks.fold), blocks.without_folds, strict=True):
            inside = np.flatnonzero(blocks.fold == fold)
            sums = outside, len(blocks) - len(inside)
            fitted = _solve(fits, blocks, model, (spline_columns(form), penalty), sums)
            losses[inside] = blocks.losses(*fitted, inside)
        trials.append(FreeSpline(form, penalty, before - losses))
    return max(trials, key=lambda spline: float(spline.gains.sum()))


def _solve(
    fits: MachineFits,
    blocks: Blocks,
    model: FittedModel,
    spline: tuple[Sequence[Column], Samples],
    sums: tuple[Samples, int],
) -> tuple[tuple[Column, ...], Samples]:
    """Columns and coefficients of a model and a spline on some blocks; what is at its bound stays there.

    `sums`: of these blocks' products, and how many they are.
    """
    columns, penalty = spline
    fit = model.fit
    every = (*fit.columns, *columns)
    places = blocks.places(every)
    total, count = sums
    matrix = total[np.ix_(places, places)].copy()
    weight = prior_weight(blocks, fit.columns, fit.coefficients, fits.priors)
    own = len(fit.columns)
    matrix[:own, :own] += np.diag(weight) * count / len(blocks)
    matrix[own:, own:] += penalty * count / len(blocks)
    coefficients = np.concatenate([np.where(fit.at_bound, fit.coefficients, 0.0), np.zeros(len(columns))])
    free = np.concatenate([np.logical_not(fit.at_bound), np.ones(len(columns), dtype=bool)])
    right = total[places, -1] - matrix @ coefficients
    size = np.sqrt(np.maximum(np.diag(matrix)[free], np.finfo(float).tiny))
    scaled = matrix[np.ix_(free, free)] / np.outer(size, size)
    coefficients[free] += np.linalg.lstsq(scaled, right[free] / size, rcond=1e-12)[0] / size
    return every, coefficients


def with_spline(fits: MachineFits, blocks: Blocks, model: FittedModel, spline: FreeSpline) -> FittedModel:
    """Model with a spline beside its terms, fitted to all blocks."""
    every, coefficients = _solve(
        fits, blocks, model, (spline.columns, spline.penalty), (blocks.products.sum(axis=0), len(blocks))
    )
    unknown = np.full(len(every), math.nan)
    at_bound = np.append(model.fit.at_bound, np.zeros(len(spline.columns), dtype=bool))
    return replace(model, fit=replace(
        model.fit, columns=every, coefficients=coefficients, low=unknown, high=unknown, at_bound=at_bound
    ))  # fmt: skip


def information_of(
    blocks: Blocks, model: FittedModel, columns: Sequence[Column], priors: Mapping[Column, NumberPrior]
) -> tuple[Samples, Samples, float]:
    """Information that blocks have of coefficients beside others of a model, (K, K), and their pull, (K,).

    Both over the variance, which is the third: what is left scatters by blocks, and a block counts as so many
    independent pieces. What is at its bound stays there.
    """
    fit, total = model.fit, blocks.products.sum(axis=0)
    others = [place for place, column in enumerate(fit.columns) if column not in set(columns)]
    own = [place for place in others if not fit.at_bound[place]]
    held = [place for place in others if fit.at_bound[place]]
    inside = blocks.places(columns)
    beside, at_bound = (blocks.places([fit.columns[place] for place in part]) for part in (own, held))
    variance = float(blocks.losses(fit.columns, fit.coefficients).sum()) / blocks.pieces
    beside_it = [fit.columns[place] for place in others]
    weight = dict(zip(others, prior_weight(blocks, beside_it, fit.coefficients[others], priors), strict=True))
    matrix = total[np.ix_(beside, beside)] + np.diag([weight[place] for place in own])
    target = total[:, -1] - total[:, at_bound] @ fit.coefficients[held]
    inverse = np.linalg.pinv(matrix, rcond=1e-12, hermitian=True)
    cross = total[np.ix_(inside, beside)]
    information = total[np.ix_(inside, inside)] - cross @ inverse @ cross.T
    pull = target[inside] - cross @ inverse @ target[beside]
    return information / variance, pull / variance, variance


def tangent_of(
    blocks: Blocks, fits: MachineFits, model: FittedModel, spline: FreeSpline, tested: tuple[float, float]
) -> tuple[Tangent, float]:
    """Quadratic log-likelihood of the spline's coefficients, and the variance that it is over."""
    information, pull, variance = information_of(blocks, model, spline.columns, fits.priors)
    count = len(spline.columns)
    quadratic = Tangent(
        information,
        pull,
        *tested,
        samples=int(blocks.pieces),
        constant=False,
        fitted=model.fit.coefficients[-count:],
        others=np.zeros(0),
        response=np.zeros((0, count)),
    )
    return quadratic, variance


def spline_function(tangent: Tangent, penalty: Samples, tested: tuple[float, float]) -> FittedFunction:
    """Spline, and the 95 % band of it less its mean, which the machine's own friction or offset takes up."""
    u = np.linspace(*tested, DRAWN)
    basis = splines(u, *tested).T
    covariance = np.linalg.pinv(tangent.information + penalty, rcond=1e-12, hermitian=True)
    moving = basis - basis.mean(axis=0)
    std = np.sqrt(np.maximum(np.einsum("nk,kl,nl->n", moving, covariance, moving), 0.0))
    value = basis @ tangent.fitted
    return FittedFunction(u, value, value - BAND * std, value + BAND * std)
