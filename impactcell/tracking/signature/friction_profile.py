"""Friction along one slide as a linear Gaussian problem, solved exactly.

While the part slides, x'' = -g mu(x) + a(x'), with a what the model's effects do to it. Position itself is
measured to a micrometre, where friction changes over tenths of a millimetre, so the measured x may stand as
the argument of mu. With mu(x) = sum_j beta_j B_j(x), cubic B-splines on the grid, position is linear in what
is unknown::

    x(t) - int int a(x') dt dt = x_0 + v_0 t - g sum_j beta_j W_j(t) + e,   W_j'' = B_j(x(t))

x_0 and v_0 are integrated out; what is left of the slide are an information matrix G and vector h:
log likelihood = -1/2 beta' G beta + h' beta. This is the Rauch-Tung-Striebel smoother of an integrated
random walk in x (Wecker & Ansley 1983, JASA 78:81) without its first-order errors in time.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from impactcell.features import SlideSegment
from impactcell.numerics import small_linalg
from impactcell.numerics.jit import compiled
from impactcell.records import Samples
from impactcell.tracking.signature import spline_integrals

Acceleration = Callable[[Samples], Samples]
"""Speeds along the tap, m/s, to the acceleration along it, m/s², that a model knows beside friction."""

MIN_BLOCKS = 8
"""Blocks that are left of a slide that is cut off, at least: twice the unknowns of a cubic in time."""
SMOOTHING_STRENGTHS = np.logspace(-9.0, 9.0, 37)
"""Strengths of the smoothing searched, over that which weighs like the data: none to a straight line."""


@dataclass(frozen=True, slots=True, eq=False)
class SplineInformation:
    """What one slide says of the spline coefficients.

    Attributes
    ----------
    matrix, vector : ndarray
        G and h, shapes (j, j) and (j,).
    reached_m : float
        How far the part slid.
    coefficients : int
        Coefficients of the splines it met; rows of G and h beyond are zero.
    """

    matrix: Samples
    vector: Samples
    reached_m: float
    coefficients: int

    @property
    def fields(self) -> tuple[Samples, Samples, int]:
        """What a `SlideInformation` is made of; compiled code is called with plain tuples in less time."""
        return self.matrix, self.vector, self.coefficients


class SlideInformation(NamedTuple):
    """Matrix G and vector h of a cycle, and how many of their first rows are not zero; in compiled code."""

    matrix: Samples
    vector: Samples
    coefficients: int


def information(
    slide: SlideSegment,
    grid_m: Samples,
    gravity_m_s2: float,
    acceleration: Acceleration | None = None,
) -> SplineInformation:
    """Turn a slide into information on the coefficients of the cubic B-splines of a uniform grid.

    Parameters
    ----------
    grid_m : ndarray, shape (g,)
        Uniform, from 0. There are g + 2 coefficients. What the part slid beyond its end does not count: to
        take friction there for the last on the grid would make any that differs pass for friction before.
    acceleration : callable, optional
        What the model's effects do to the part at a speed: one cycle cannot tell it from mu(x).
    """
    slide = _on_grid(slide, float(grid_m[-1]))
    moved_m = (
        np.zeros(len(slide.time_s)) if acceleration is None else _known_displacement(slide, acceleration)
    )
    fields = spline_integrals.information(
        slide.time_s, slide.distance_m, moved_m, slide.variance, grid_m, gravity_m_s2
    )
    return SplineInformation(*fields)


def _on_grid(slide: SlideSegment, end_m: float) -> SlideSegment:
    """Cut a slide off after its first block beyond the grid."""
    beyond = np.flatnonzero(slide.distance_m > end_m)
    if not len(beyond):
        return slide
    count = max(int(beyond[0]) + 1, MIN_BLOCKS)
    return replace(slide, time_s=slide.time_s[:count], distance_m=slide.distance_m[:count])


def _known_displacement(slide: SlideSegment, acceleration: Acceleration) -> Samples:
    """Integrate a known acceleration twice over the time of a slide, up to a line in time.

    The part of it that is proportional to the speed needs no speed: its double integral is that of the
    measured position, exact for viscous friction. What is left is taken at the speeds of a cubic in time, for
    a slide passes a parabola's speeds or so.
    """
    t = slide.time_s
    speed = np.maximum(_speed_of_cubic(t, slide.distance_m), 0.0)
    a = acceleration(speed)
    about = speed - speed.mean()
    rate = float(about @ a) / max(float(about @ about), np.finfo(float).tiny)
    a = a - rate * speed
    step = np.diff(t)
    gained = np.concatenate([[0.0], np.cumsum(0.5 * (a[1:] + a[:-1]) * step)])
    ahead = gained[:-1] * step + (2.0 * a[:-1] + a[1:]) * step**2 / 6.0
    ahead += rate * 0.5 * (slide.distance_m[1:] + slide.distance_m[:-1]) * step
    moved: Samples = np.concatenate([[0.0], np.cumsum(ahead)])
    return moved


def _speed_of_cubic(time_s: Samples, distance_m: Samples) -> Samples:
    """Speed by the cubic in time that fits distances best, by least squares; the first time is zero, s.

    As numpy's `Polynomial.fit` and `deriv` have it, to the bit, in half the time: columns of norm one,
    singular values below the rounding of so many samples left out.
    """
    scale = 1.0 / time_s[-1]
    x = scale * time_s
    powers = np.empty((4, len(x)))
    powers[0], powers[1] = 1.0, x
    powers[2] = x * x
    powers[3] = powers[2] * x
    norms = np.sqrt(np.square(powers).sum(1))
    solution, *_ = np.linalg.lstsq(powers.T / norms, distance_m, len(x) * np.finfo(np.float64).eps)
    _, first, second, third = (solution / norms * scale).tolist()
    slope: Samples = first + (2.0 * second + 3.0 * third * x) * x
    return slope


@lru_cache(maxsize=64)
def on_grid(points: int) -> Samples:
    """Matrix from g + 2 coefficients to friction at the g grid points, shape (g, g + 2)."""
    matrix = np.zeros((points, points + 2))
    for i in range(points):
        matrix[i, i : i + 3] = (1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0)
    matrix.flags.writeable = False
    return matrix


@lru_cache(maxsize=8)
def shape_coefficients(points: int) -> Samples:
    """Matrix that takes shapes on the grid, as rows, to those of their coefficients, shape (g, g + 2)."""
    matrix: Samples = np.asarray(np.linalg.pinv(on_grid(points)).T, dtype=np.float64)
    matrix.flags.writeable = False
    return matrix


@compiled
def roughness(coefficients: int) -> Samples:
    """Penalty D of second differences, shape (j, j)."""
    penalty = np.zeros((coefficients, coefficients))
    difference = (1.0, -2.0, 1.0)
    for k in range(coefficients - 2):
        for i in range(3):
            for j in range(3):
                penalty[k + i, k + j] += difference[i] * difference[j]
    return penalty


def smooth(slide: SplineInformation, grid_m: Samples) -> tuple[Samples, float]:
    """Posterior mean of the coefficients met under exp(-lambda/2 beta' D beta), and the likeliest lambda.

    lambda is weighted by its restricted likelihood. Coefficients beyond follow the last ones in a straight
    line, at no penalty, so that they may be left out.
    """
    mean, strength, _, _ = _smoothed(
        slide.matrix, slide.vector, slide.coefficients, slide.reached_m, grid_m, SMOOTHING_STRENGTHS
    )
    return mean, strength


def friction(slide: SplineInformation, grid_m: Samples) -> tuple[Samples, Samples]:
    """Friction and its standard deviation on the grid, by `smooth`; nan where the part did not get."""
    _, _, value, std = _smoothed(
        slide.matrix, slide.vector, slide.coefficients, slide.reached_m, grid_m, SMOOTHING_STRENGTHS
    )
    return value, std


@compiled
def _smoothed(
    matrix: Samples, vector: Samples, n: int, reached: float, grid: Samples, strengths: Samples
) -> tuple[Samples, float, Samples, Samples]:
    """Mean and strength of `smooth`, and what `friction` gives."""
    rough, within, trace = roughness(n), small_linalg.block(matrix, 0, n, 0, n), 0.0
    for i in range(n):
        trace += within[i, i]
    scale = trace / (6.0 * (n - 2))  # of D the trace is 6 (n - 2)
    for i in range(n):
        for j in range(n):
            rough[i, j] *= scale
            within[i, j] += rough[i, j]
    # both matrices diagonal at once: base = L L', scale D = L Q diag(e) Q' L', matrix has 1 - e
    lower = small_linalg.cholesky(within)
    half = small_linalg.solve_lower(lower, rough)
    share, axes = np.linalg.eigh(small_linalg.solve_lower(lower, half.T.copy()))
    vectors = small_linalg.solve_upper(lower, axes)
    many = len(strengths)
    inner, means, inverse = np.zeros(n), np.empty((n, many)), np.empty((n, many))
    fit, determinant = (n - 2) * np.log(strengths), np.ones(many)
    for i in range(n):
        # level and slope are not penalised; rounding must not say otherwise
        penalised = min(max(share[i], 0.0), 1.0) if i > 1 else 0.0
        for j in range(n):
            inner[i] += vectors[j, i] * vector[j]
        for k in range(many):
            diagonal = (1.0 - penalised) + strengths[k] * penalised
            inverse[i, k] = 1.0 / diagonal
            means[i, k] = inner[i] * inverse[i, k]
            fit[k] += inner[i] * means[i, k]
            determinant[k] *= diagonal
        if i % 16 == 15 or i == n - 1:  # the product of more of them might be too large a number
            fit -= np.log(determinant)
            determinant[:] = 1.0
    best = int(fit.argmax())
    # averaged over what lambda may be: the most likely one alone smooths away features it should doubt
    weight = np.exp(0.5 * (fit - fit[best]))
    weight /= weight.sum()
    mean, spread = np.zeros(n), np.zeros((n, n))
    for i in range(n):
        for k in range(many):
            mean[i] += weight[k] * means[i, k]
            spread[i, i] += weight[k] * inverse[i, k]
        for k in range(many):
            means[i, k] = (means[i, k] - mean[i]) * math.sqrt(weight[k])
    spread += means @ means.T
    value, std = np.full(len(grid), np.nan), np.full(len(grid), np.nan)
    at = np.empty((n - 2, n))
    for k in range(n - 2):
        for j in range(n):
            at[k, j] = (vectors[k, j] + 4.0 * vectors[k + 1, j] + vectors[k + 2, j]) / 6.0
    image = at @ spread
    for k in range(n - 2):
        if grid[k] <= reached:
            variance, value[k] = 0.0, 0.0
            for j in range(n):
                value[k] += at[k, j] * mean[j]
                variance += at[k, j] * image[k, j]
            std[k] = math.sqrt(max(variance, 0.0))
    return vectors @ mean, strengths[best] * scale, value, std
