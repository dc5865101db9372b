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

import numpy as np
from scipy.linalg import cho_factor, cho_solve, eigh

from impactcell.compiled import compiled
from impactcell.records import Samples
from impactcell.tracking.slide import Slide

FINE_STEPS = 500  # of the double integral over a slide
ROUGHNESS_DECADES = (-9.0, 9.0)  # of the smoothing parameter searched


@dataclass(frozen=True, slots=True, eq=False)
class Information:
    """What one slide says of the spline coefficients: shape (j, j) and (j,)."""

    matrix: Samples
    vector: Samples
    reached_m: float


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
    spacing = float(grid_m[1] - grid_m[0])
    integrals = _double_integrals(path, fine[1] - fine[0], float(grid_m[0]), spacing, len(grid_m))
    place = (t - fine[0]) / (fine[1] - fine[0])
    low = np.minimum(place.astype(np.int64), FINE_STEPS - 2)
    part = (place - low)[:, np.newaxis]
    at_blocks = integrals[low] * (1.0 - part) + integrals[low + 1] * part
    measured = x
    if viscous_per_mass != 0.0:
        travelled = np.concatenate([[0.0], np.cumsum((path[1:] + path[:-1]) / 2.0) * (fine[1] - fine[0])])
        measured = x + viscous_per_mass * np.interp(t, fine, travelled)
    weight = 1.0 / np.sqrt(slide.variance)
    columns = -gravity_m_s2 * at_blocks * weight[:, np.newaxis]
    # integrating x_0 and v_0 out projects their two columns away
    q = _orthonormal(weight, weight * t)
    columns = columns - q @ (q.T @ columns)
    target = measured * weight
    target = target - q @ (q.T @ target)
    return Information(columns.T @ columns, columns.T @ target, float(x[-1]))


def on_grid(points: int) -> Samples:
    """Matrix from g + 2 coefficients to friction at the g grid points, shape (g, g + 2)."""
    matrix = np.zeros((points, points + 2))
    for i in range(points):
        matrix[i, i : i + 3] = (1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0)
    return matrix


def roughness(coefficients: int) -> Samples:
    """Penalty D of second differences, shape (j, j)."""
    second = np.diff(np.eye(coefficients), 2, axis=0)
    return second.T @ second


def smooth(matrix: Samples, vector: Samples, penalty: Samples) -> tuple[Samples, Samples, float]:
    """Posterior of coefficients under exp(-lambda/2 beta' D beta), lambda weighted by restricted likelihood.

    Returns
    -------
    mean : ndarray, shape (j,)
    covariance : ndarray, shape (j, j)
    strength : float
        The lambda of largest likelihood.
    """
    scale = float(np.trace(matrix)) / float(np.trace(penalty))
    base = matrix + scale * penalty
    # both matrices diagonal at once: base = V^-T V^-1, scale D = V^-T diag(e) V^-1, matrix has 1 - e
    share, vectors = eigh(scale * penalty, base)
    share = np.clip(share, 0.0, 1.0)
    share[:2] = 0.0  # level and slope are not penalised; rounding must not say otherwise
    inner = vectors.T @ vector
    strengths = np.logspace(*ROUGHNESS_DECADES, 37)
    diagonal = (1.0 - share)[np.newaxis, :] + strengths[:, np.newaxis] * share[np.newaxis, :]
    diagonal = np.maximum(diagonal, 1e-300)
    fit = (
        (inner**2 / diagonal).sum(axis=1)
        - np.log(diagonal).sum(axis=1)
        + (len(share) - 2) * np.log(strengths)
    )
    # averaged over what lambda may be: the most likely one alone smooths away features it should doubt
    share_of = np.exp(0.5 * (fit - fit.max()))
    share_of /= share_of.sum()
    inverse = share_of @ (1.0 / diagonal)
    means = inner / diagonal
    spread = means - share_of @ means
    covariance = (vectors * inverse) @ vectors.T
    covariance += vectors @ ((spread * share_of[:, np.newaxis]).T @ spread) @ vectors.T
    return vectors @ (share_of @ means), covariance, float(strengths[int(np.argmax(fit))] * scale)


def posterior(matrix: Samples, vector: Samples, penalty: Samples, strength: float) -> tuple[Samples, Samples]:
    """Posterior mean and covariance of coefficients at a given lambda."""
    factor = cho_factor(matrix + strength * penalty)
    return cho_solve(factor, vector), cho_solve(factor, np.eye(len(vector)))


def _orthonormal(first: Samples, second: Samples) -> Samples:
    """Orthonormal basis of two columns, shape (n, 2)."""
    one = first / np.sqrt(first @ first)
    other = second - (one @ second) * one
    return np.column_stack([one, other / np.sqrt(other @ other)])


@compiled
def _double_integrals(path: Samples, step: float, first: float, spacing: float, points: int) -> Samples:
    """Integrate every B-spline twice along the path; trapezium, then the exact second integral of it."""
    n, j = len(path), points + 2
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
