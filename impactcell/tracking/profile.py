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

FINE_STEPS = 500  # of the double integral over a slide
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
    fine = np.linspace(min(t[0], 0.0), t[-1], FINE_STEPS)
    # between blocks the path bends by less than a micrometre, which friction does not notice
    path = np.interp(fine, t, x)
    points, spacing = len(grid_m), float(grid_m[1] - grid_m[0])
    integrals = _double_integrals(path, float(fine[1] - fine[0]), float(grid_m[0]), spacing, points)
    weight = 1.0 / np.sqrt(slide.variance)
    columns = _columns(t, x, weight, fine, path, integrals, gravity_m_s2, viscous_per_mass)
    # integrating x_0 and v_0 out projects their two columns away
    q = _orthonormal(weight, weight * t)
    columns -= q @ (q.T @ columns)
    products = columns.T @ columns
    seen = integrals.shape[1]
    matrix, vector = np.zeros((points + 2, points + 2)), np.zeros(points + 2)
    matrix[:seen, :seen], vector[:seen] = products[:seen, :seen], products[:seen, seen]
    return Information(matrix, vector, float(x[-1]), seen)


def _orthonormal(first: Samples, second: Samples) -> Samples:
    """Orthonormal basis of two columns, shape (n, 2)."""
    one = first / np.sqrt(first @ first)
    other = second - (one @ second) * one
    return np.column_stack([one, other / np.sqrt(other @ other)])


@lru_cache(maxsize=64)
def on_grid(points: int) -> Samples:
    """Matrix from g + 2 coefficients to friction at the g grid points, shape (g, g + 2)."""
    matrix = np.zeros((points, points + 2))
    for i in range(points):
        matrix[i, i : i + 3] = (1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0)
    matrix.flags.writeable = False
    return matrix


@lru_cache(maxsize=64)
def roughness(coefficients: int) -> Samples:
    """Penalty D of second differences, shape (j, j)."""
    second = np.diff(np.eye(coefficients), 2, axis=0)
    penalty: Samples = second.T @ second
    penalty.flags.writeable = False
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
    n = seen.seen
    matrix, penalty = seen.matrix[:n, :n], roughness(n)
    scale = float(np.trace(matrix)) / float(np.trace(penalty))
    # both matrices diagonal at once: base = V^-T V^-1, scale D = V^-T diag(e) V^-1, matrix has 1 - e
    share, vectors = linear.both_diagonal(scale * penalty, matrix + scale * penalty)
    share = np.minimum(np.maximum(share, 0.0), 1.0)
    share[:2] = 0.0  # level and slope are not penalised; rounding must not say otherwise
    inner = vectors.T @ seen.vector[:n]
    diagonal = np.maximum((1.0 - share) + STRENGTHS[:, np.newaxis] * share, 1e-300)
    fit = (inner**2 / diagonal - np.log(diagonal)).sum(axis=1) + (n - 2) * np.log(STRENGTHS)
    best = int(fit.argmax())
    # averaged over what lambda may be: the most likely one alone smooths away features it should doubt
    share_of = np.exp(0.5 * (fit - fit[best]))
    share_of /= share_of.sum()
    means = inner / diagonal
    spread = means - share_of @ means
    within = (spread.T * share_of) @ spread
    within.flat[:: n + 1] += share_of @ (1.0 / diagonal)
    return vectors @ (share_of @ means), vectors @ within @ vectors.T, float(STRENGTHS[best] * scale)


@compiled
def _columns(
    t: Samples,
    x: Samples,
    weight: Samples,
    fine: Samples,
    path: Samples,
    integrals: Samples,
    gravity: float,
    viscous_per_mass: float,
) -> Samples:
    """Weighted columns of the coefficients, and position last, at the blocks, shape (n, s + 1)."""
    seen, step = integrals.shape[1], fine[1] - fine[0]
    travelled = np.zeros(len(fine))
    for k in range(1, len(fine)):
        travelled[k] = travelled[k - 1] + (path[k] + path[k - 1]) / 2.0 * step
    columns = np.empty((len(t), seen + 1))
    for k in range(len(t)):
        place = (t[k] - fine[0]) / step
        low = min(int(place), len(fine) - 2)
        part = place - low
        for i in range(seen):
            at_block = integrals[low, i] * (1.0 - part) + integrals[low + 1, i] * part
            columns[k, i] = -gravity * at_block * weight[k]
        drag = travelled[low] * (1.0 - part) + travelled[low + 1] * part
        columns[k, seen] = (x[k] + viscous_per_mass * drag) * weight[k]
    return columns


@compiled
def _double_integrals(path: Samples, step: float, first: float, spacing: float, points: int) -> Samples:
    """Integrate every B-spline met twice along the path; trapezium, then the exact second integral of it."""
    n = len(path)
    furthest = 0.0
    for k in range(n):
        furthest = max(furthest, (path[k] - first) / spacing)
    j = min(int(furthest), points - 2) + 4
    out = np.zeros((n, j))
    speed = np.zeros(j)
    before = np.zeros(j)
    now = np.zeros(j)
    for k in range(n):
        place = (path[k] - first) / spacing
        place = min(max(place, 0.0), points - 1.0)
        cell = min(int(place), points - 2)
        u = place - cell
        for i in range(j):
            now[i] = 0.0
        now[cell] = (1.0 - u) ** 3 / 6.0
        now[cell + 1] = (3.0 * u**3 - 6.0 * u**2 + 4.0) / 6.0
        now[cell + 2] = (-3.0 * u**3 + 3.0 * u**2 + 3.0 * u + 1.0) / 6.0
        now[cell + 3] = u**3 / 6.0
        if k > 0:
            for i in range(j):
                out[k, i] = out[k - 1, i] + step * speed[i] + step**2 * (2.0 * before[i] + now[i]) / 6.0
                speed[i] += step * (before[i] + now[i]) / 2.0
        for i in range(j):
            before[i] = now[i]
    return out
