"""Friction along one slide as a linear Gaussian problem, solved exactly.

While the part slides, x'' = -g mu(x) - (k_v / m) x'. Position itself is measured to a micrometre, where
friction changes over tenths of a millimetre, so the measured x may stand as the argument of mu. With
mu(x) = sum_j beta_j B_j(x), cubic B-splines on the grid, position is linear in what is unknown::

    x(t) + (k_v / m) int (x - x_0) dt = x_0 + v_0 t - g sum_j beta_j W_j(t) + e,   W_j'' = B_j(x(t))

x_0 and v_0 are integrated out; what is left of the slide are an information matrix G and vector h:
log likelihood = -1/2 beta' G beta + h' beta. This is the Rauch-Tung-Striebel smoother of an integrated
random walk in x (Wecker & Ansley 1983, JASA 78:81) without its first-order errors in time.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from impactcell.compiled import compiled
from impactcell.records import Samples
from impactcell.tracking import linear
from impactcell.tracking.slide import Slide

FINE_STEPS = 300  # of the double integral over a slide, at least
NEGLIGIBLE = 1e-12  # share of a smoothing that is left out
STRENGTHS = np.logspace(-9.0, 9.0, 37)  # of the smoothing searched, over that which weighs like the data


@dataclass(frozen=True, slots=True, eq=False)
class Information:
    """What one slide says of the spline coefficients.

    Attributes
    ----------
    matrix, vector : ndarray
        G and h, shapes (j, j) and (j,).
    reached_m : float
        How far the part slid.
    seen : int
        Coefficients of the splines it met; rows of G and h beyond are zero.
    """

    matrix: Samples
    vector: Samples
    reached_m: float
    seen: int


def information(
    slide: Slide, grid_m: Samples, gravity_m_s2: float, viscous_per_mass: float = 0.0
) -> Information:
    """Turn a slide into information on the coefficients of the cubic B-splines of a uniform grid.

    Parameters
    ----------
    grid_m : ndarray, shape (g,)
        Uniform; friction beyond its ends is that at the ends. There are g + 2 coefficients.
    viscous_per_mass : float
        k_v / m where the model knows it, 1/s.
    """
    t, x = slide.time_s, slide.distance_m
    points, first = len(grid_m), float(grid_m[0])
    columns = _columns(t, x, first, float(grid_m[1]) - first, points, gravity_m_s2, viscous_per_mass)
    products = columns.T @ columns / slide.variance
    seen = len(products) - 1
    matrix, vector = np.zeros((points + 2, points + 2)), np.zeros(points + 2)
    matrix[:seen, :seen], vector[:seen] = products[:seen, :seen], products[:seen, seen]
    return Information(matrix, vector, float(x[-1]), seen)


@lru_cache(maxsize=64)
def on_grid(points: int) -> Samples:
    """Matrix from g + 2 coefficients to friction at the g grid points, shape (g, g + 2)."""
    matrix = np.zeros((points, points + 2))
    for i in range(points):
        matrix[i, i : i + 3] = (1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0)
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


def smooth(seen: Information) -> tuple[Samples, Samples, float]:
    """Posterior of the coefficients seen under exp(-lambda/2 beta' D beta), s in number.

    lambda is weighted by its restricted likelihood. Coefficients beyond follow the last ones in a straight
    line, at no penalty, so that they may be left out.

    Returns
    -------
    mean : ndarray, shape (s,)
    covariance : ndarray, shape (s, s)
    strength : float
        The lambda of largest likelihood.
    """
    return _smoothed(seen.matrix, seen.vector, seen.seen, STRENGTHS)


def friction(seen: Information, points: int) -> tuple[Samples, Samples]:
    """Friction and its standard deviation on the grid of so many points; nan where no spline was met."""
    mean, covariance, _ = smooth(seen)
    return _on_grid(mean, covariance, points)


@compiled
def _on_grid(mean: Samples, covariance: Samples, points: int) -> tuple[Samples, Samples]:
    value, std = np.full(points, np.nan), np.full(points, np.nan)
    weight = (1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0)
    for k in range(len(mean) - 2):
        total, variance = 0.0, 0.0
        for i in range(3):
            total += weight[i] * mean[k + i]
            for j in range(3):
                variance += weight[i] * weight[j] * covariance[k + i, k + j]
        value[k], std[k] = total, np.sqrt(max(variance, 0.0))
    return value, std


@compiled
def _smoothed(matrix: Samples, vector: Samples, n: int, strengths: Samples) -> tuple[Samples, Samples, float]:
    penalty, within = roughness(n), matrix[:n, :n].copy()
    scale = np.trace(within) / np.trace(penalty)
    # both matrices diagonal at once: base = L L', scale D = L Q diag(e) Q' L', matrix has 1 - e
    lower = linear.factor(within + scale * penalty)
    half = linear.forward(lower, scale * penalty)
    share, axes = np.linalg.eigh(linear.forward(lower, half.T.copy()))
    share = np.minimum(np.maximum(share, 0.0), 1.0)
    share[:2] = 0.0  # level and slope are not penalised; rounding must not say otherwise
    vectors = linear.backward(lower, axes)
    inner = vectors.T @ vector[:n].copy()
    fit = np.empty(len(strengths))
    for k in range(len(strengths)):
        fit[k] = (n - 2) * np.log(strengths[k])
        for i in range(n):
            diagonal = max((1.0 - share[i]) + strengths[k] * share[i], 1e-300)
            fit[k] += inner[i] ** 2 / diagonal - np.log(diagonal)
    best = int(fit.argmax())
    # averaged over what lambda may be: the most likely one alone smooths away features it should doubt
    share_of = np.exp(0.5 * (fit - fit[best]))
    share_of /= share_of.sum()
    mean, spread, inverse = np.zeros(n), np.zeros((n, n)), np.zeros(n)
    means = np.empty((len(strengths), n))
    for k in range(len(strengths)):
        for i in range(n):
            diagonal = max((1.0 - share[i]) + strengths[k] * share[i], 1e-300)
            means[k, i] = inner[i] / diagonal
            mean[i] += share_of[k] * means[k, i]
            inverse[i] += share_of[k] / diagonal
    for k in range(len(strengths)):
        if share_of[k] > NEGLIGIBLE:
            for i in range(n):
                part = share_of[k] * (means[k, i] - mean[i])
                for j in range(n):
                    spread[i, j] += part * (means[k, j] - mean[j])
    for i in range(n):
        spread[i, i] += inverse[i]
    return vectors @ mean, vectors @ spread @ vectors.T, strengths[best] * scale


@compiled
def _columns(
    t: Samples, x: Samples, first: float, spacing: float, points: int, gravity: float, viscous_per_mass: float
) -> Samples:
    """Columns of the coefficients met, and position last, at the blocks, shape (n, s + 1).

    Every B-spline is integrated twice along the path: trapezium, then the exact second integral of it.
    x_0 and v_0 are integrated out, which projects the columns 1 and t away; so the integrals may start
    anywhere.
    """
    n, furthest = len(t), 0.0
    for k in range(n):
        furthest = max(furthest, (x[k] - first) / spacing)
    seen = min(int(furthest), points - 2) + 4
    columns = np.empty((n, seen + 1))
    now, speed = np.zeros(seen), np.zeros(seen)
    before, place = np.zeros(seen), np.zeros(seen)
    parts = max(1, FINE_STEPS // n)
    travelled = 0.0
    met = _splines(x[0], first, spacing, points, before) + 4
    for k in range(n):
        if k > 0:
            step = (t[k] - t[k - 1]) / parts
            for part in range(parts):
                # between blocks the path bends by less than a micrometre, which friction does not notice
                at = x[k - 1] + (x[k] - x[k - 1]) * (part + 1.0) / parts
                met = max(met, _splines(at, first, spacing, points, now) + 4)
                for i in range(met):
                    place[i] += step * speed[i] + step**2 * (2.0 * before[i] + now[i]) / 6.0
                    speed[i] += step * (before[i] + now[i]) / 2.0
                    before[i] = now[i]
            travelled += (x[k] + x[k - 1]) / 2.0 * (t[k] - t[k - 1])
        for i in range(seen):
            columns[k, i] = -gravity * place[i]
        columns[k, seen] = x[k] + viscous_per_mass * travelled
    _project(t, columns)
    return columns


@compiled
def _splines(x: float, first: float, spacing: float, points: int, out: Samples) -> int:
    """Values of all B-splines at a place; gives the first of the four that are not zero."""
    place = min(max((x - first) / spacing, 0.0), points - 1.0)
    cell = min(int(place), points - 2)
    u = place - cell
    out[:] = 0.0
    out[cell] = (1.0 - u) ** 3 / 6.0
    out[cell + 1] = (3.0 * u**3 - 6.0 * u**2 + 4.0) / 6.0
    out[cell + 2] = (-3.0 * u**3 + 3.0 * u**2 + 3.0 * u + 1.0) / 6.0
    out[cell + 3] = u**3 / 6.0
    return cell


@compiled
def _project(t: Samples, columns: Samples) -> None:
    """Take mean and slope over time out of every column, in place."""
    n, width = columns.shape
    centre, square = t.mean(), 0.0
    mean, slope = np.zeros(width), np.zeros(width)
    for k in range(n):
        square += (t[k] - centre) ** 2
        for i in range(width):
            mean[i] += columns[k, i]
            slope[i] += (t[k] - centre) * columns[k, i]
    mean /= n
    slope /= square
    for k in range(n):
        for i in range(width):
            columns[k, i] -= mean[i] + slope[i] * (t[k] - centre)
