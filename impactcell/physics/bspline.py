"""Cubic B-splines on uniform knots (de Boor, A Practical Guide to Splines, 1978), straight beyond them."""

import numpy as np
from numpy.typing import ArrayLike

from impactcell.numerics.jit import FloatPointer, compiled
from impactcell.records import Samples


@compiled
def spline(u: float, p: FloatPointer, spans: int) -> float:
    """Cubic B-spline at u; knots from p[0] to p[1], coefficients from p[2] on; straight beyond."""
    width = (p[1] - p[0]) / spans
    w = (u - p[0]) / width
    inside = min(max(w, 0.0), float(spans))
    i = min(int(inside), spans - 1)
    t = inside - i
    a, b, c, d = p[2 + i], p[3 + i], p[4 + i], p[5 + i]
    s = 1.0 - t
    value = (
        a * s * s * s + b * (3.0 * t * t * t - 6.0 * t * t + 4.0)
        + c * (1.0 + 3.0 * t + 3.0 * t * t - 3.0 * t * t * t) + d * t * t * t
    ) / 6.0  # fmt: skip
    slope = (-a * s * s + b * (3.0 * t * t - 4.0 * t) + c * (1.0 + 2.0 * t - 3.0 * t * t) + d * t * t) / 2.0
    return value + slope * (w - inside)


def spline_basis(u: ArrayLike, lower: float, upper: float, spans: int) -> Samples:
    """Values of the B-splines, shape (n, spans + 3), at u of shape (n,); straight beyond the knots."""
    points = np.atleast_1d(np.asarray(u, dtype=np.float64))
    w = (points - lower) * (spans / (upper - lower))
    inside = np.clip(w, 0.0, float(spans))
    i = np.minimum(inside.astype(np.int64), spans - 1)
    t = inside - i
    beyond = w - inside
    value = np.stack([(1.0 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, 1 + 3 * t + 3 * t**2 - 3 * t**3, t**3]) / 6.0
    slope = np.stack([-((1.0 - t) ** 2), 3 * t**2 - 4 * t, 1 + 2 * t - 3 * t**2, t**2]) / 2.0
    basis = np.zeros((len(points), spans + 3))
    for k in range(4):
        basis[np.arange(len(points)), i + k] += value[k] + slope[k] * beyond
    return basis
