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
    if w == inside:
        return value
    slope = (-a * s * s + b * (3.0 * t * t - 4.0 * t) + c * (1.0 + 2.0 * t - 3.0 * t * t) + d * t * t) / 2.0
    return value + slope * (w - inside)


@compiled
def tensor_spline(u: float, w: float, p: FloatPointer, spans: int) -> float:
    """Cubic B-spline in u times one of a single piece in w, straight beyond the knots of either.

    Knots of u from p[0] to p[1], of w from p[2] to p[3]; coefficients from p[4] on, first those of the
    first B-spline of w.
    """
    x = (u - p[0]) * spans / (p[1] - p[0])
    y = (w - p[2]) / (p[3] - p[2])
    inside = min(max(x, 0.0), float(spans))
    i = min(int(inside), spans - 1)
    t, v = inside - i, min(max(y, 0.0), 1.0)
    s, r = 1.0 - t, 1.0 - v
    total = 0.0
    for j in range(4):
        # Weights of the four B-splines at a place, and their slopes beyond it.
        if j == 0:
            weight, slope = r * r * r / 6.0, -r * r / 2.0
        elif j == 1:
            weight, slope = (3.0 * v * v * v - 6.0 * v * v + 4.0) / 6.0, (3.0 * v * v - 4.0 * v) / 2.0
        elif j == 2:
            weight = (1.0 + 3.0 * v + 3.0 * v * v - 3.0 * v * v * v) / 6.0
            slope = (1.0 + 2.0 * v - 3.0 * v * v) / 2.0
        else:
            weight, slope = v * v * v / 6.0, v * v / 2.0
        at = 4 + j * (spans + 3) + i
        a, b, c, d = p[at], p[at + 1], p[at + 2], p[at + 3]
        value = (
            a * s * s * s + b * (3.0 * t * t * t - 6.0 * t * t + 4.0)
            + c * (1.0 + 3.0 * t + 3.0 * t * t - 3.0 * t * t * t) + d * t * t * t
        ) / 6.0  # fmt: skip
        if x != inside:
            rise = (
                -a * s * s + b * (3.0 * t * t - 4.0 * t) + c * (1.0 + 2.0 * t - 3.0 * t * t) + d * t * t
            ) / 2.0
            value += rise * (x - inside)
        total += (weight + slope * (y - v)) * value
    return total


def spline_support(lower: float, upper: float, spans: int) -> tuple[Samples, Samples]:
    """Give both ends of where each B-spline is not zero, shape (spans + 3,); infinite where it goes on."""
    first = np.arange(spans + 3) - 3
    width = (upper - lower) / spans
    begin = np.where(first < 0, -np.inf, lower + first * width)
    end = np.where(first + 4 > spans, np.inf, lower + (first + 4) * width)
    return begin, end


def tensor_basis(points: Samples, ends: ArrayLike, spans: int) -> Samples:
    """Values of the products of `tensor_spline`, shape (n, 4 (spans + 3)), at points of shape (n, 2)."""
    (u_low, u_high), (w_low, w_high) = np.asarray(ends, dtype=np.float64)
    along = spline_basis(points[:, 0], u_low, u_high, spans)
    across = spline_basis(points[:, 1], w_low, w_high, 1)
    products: Samples = np.einsum("nj,ni->nji", across, along).reshape(len(points), -1)
    return products


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
