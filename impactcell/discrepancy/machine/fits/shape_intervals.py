"""How surely a model's shapes are known, and its strengths beside them.

A model is linear in its strengths at given shapes. Where the shapes are free as well, each adds a column to
the regression: the derivative of the force by the logarithm of the shape, at what was fitted (Gauss-Newton).
The scatter between blocks then gives the intervals of all of them together: a Stribeck velocity that is
hardly known widens the friction that goes with it.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.regression.block_sums import fit_blocks, lower_ends
from impactcell.discrepancy.machine.regression.nuisance_priors import OFFSET
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.regression.weak_form import Column, Rows, build_rows
from impactcell.records import Samples

STEP = 0.01
"""Of the logarithm of a shape, by which its derivative is taken to either side."""
WIDEST = math.log(10.0)
"""Half an interval of the logarithm from which on the blocks do not tell the shape: it is open."""


def with_shape_intervals(fits: MachineFits, model: FittedModel) -> FittedModel:
    """Model with 95 % intervals of its shapes, and those of its strengths with the shapes free."""
    shaped = [term for term in model.terms if len(fits.shapes[term.choice.name]) > 1]
    if not shaped:
        return model
    shapes = {term.choice: _beside(term.shape) if term in shaped else (term.shape,) for term in model.terms}
    rows = build_rows(fits.records, fits.base, shapes, (fits.gravity, fits.delay_s))
    slopes = {_slope_column(term): _slope(rows, model, term) for term in shaped}
    training, _ = fits.blocks(fits.prepared(replace(rows, columns={**_columns(rows, model), **slopes})))
    free = fit_blocks(training, [*model.fit.columns, *slopes], fits.priors, fits.nonnegative)
    half = free.high - free.coefficients
    strengths, logs = half[: len(model.fit.columns)], half[len(model.fit.columns) :]
    coefficients = model.fit.coefficients
    fit = replace(
        model.fit,
        low=lower_ends(model.fit.columns, coefficients - strengths, fits.nonnegative),
        high=coefficients + strengths,
    )
    intervals = {
        term.choice.name: _interval(term.shape, float(log) if slope.any() else math.inf)
        for term, log, slope in zip(shaped, logs, slopes.values(), strict=True)
    }
    return replace(model, fit=fit, shape_intervals=intervals)


def _beside(shape: float) -> tuple[float, float, float]:
    return shape * math.exp(-STEP), shape, shape * math.exp(STEP)


def _slope_column(term: ChosenTerm) -> Column:
    return f"shape of {term.choice.name}", term.shape, 0


def _slope(rows: Rows, model: FittedModel, term: ChosenTerm) -> Samples:
    """Differentiate a term's force by the logarithm of its shape, shape (n,)."""
    below, _, above = (ChosenTerm(term.choice, shape).columns for shape in _beside(term.shape))
    slope = np.zeros_like(rows.target)
    for own, less, more in zip(term.columns, below, above, strict=True):
        slope += model.value(own) * (rows.columns[more] - rows.columns[less]) / (2.0 * STEP)
    return slope


def _columns(rows: Rows, model: FittedModel) -> Mapping[Column, Samples]:
    return {column: rows.columns[column] for column in (*model.fit.columns, OFFSET)}


def _interval(shape: float, half: float) -> tuple[float, float]:
    """Interval of a shape, open where it is wider than `WIDEST`."""
    return (shape * math.exp(-half), shape * math.exp(half)) if half < WIDEST else (0.0, math.inf)
