"""Residuals of blocks and their normal equations, and residuals of the samples within: compiled."""

import math
from dataclasses import dataclass

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import Samples


@dataclass(frozen=True, slots=True, eq=False)
class Linearisation:
    """Normalised residuals, data minus model, and what their derivative by theta makes of them.

    Attributes
    ----------
    residual : ndarray, shape (n,)
    normal : ndarray, shape (p, p)
        Product of the derivative with itself.
    slope : ndarray, shape (p,)
        Product of the derivative with the residuals.
    chi2 : float
        Sum of squares of the residuals.
    traces : (ndarray, ndarray), shapes ((p + 1) force blocks,), ((p + 1) position blocks,)
        Force [N] and position [m] of the model at theta and, one after the other, beside it.
    """

    residual: Samples
    normal: Samples
    slope: Samples
    chi2: float
    traces: tuple[Samples, Samples]


@compiled
def linearise_blocks(
    force: Samples,
    position: Samples,
    values: Samples,
    weights: Samples,
    steps: Samples,
    beyond: tuple[int, float],
    disturbances: Samples,
) -> tuple[Samples, Samples, Samples, float]:
    """Fields of `Linearisation` from blocks of the model at theta and, one after the other, beside it.

    Parameters
    ----------
    force, position : ndarray, shape ((p + 1) force blocks,), ((p + 1) position blocks,)
    values, weights : ndarray, shape (n,)
    steps : ndarray, shape (p,)
        Which way, and how far, each parameter was moved.
    beyond : (int, float)
        Place of the parameter along which to continue, and how far.
    disturbances : ndarray, shape (d, n)
        What is eliminated, weighted: each has a normal size u about 0 with a standard deviation of 1. With U
        of these rows, chi2 is the least of |r - U' u|² + |u|² over u, r'r - (U r)' S^-1 (U r) with
        S = U U' + 1; normal equations and residuals likewise.
    """
    (ratio, far), count, size = beyond, len(steps), len(values)
    split = len(force) // (count + 1)
    residual, derivative = np.empty(size), np.empty(count)
    normal, slope = np.zeros((count, count)), np.zeros(count)
    chi2 = 0.0
    for i in range(size):
        model, row, blocks = (force, i, split) if i < split else (position, i - split, size - split)
        modelled = model[row]
        for k in range(count):
            derivative[k] = (modelled - model[(k + 1) * blocks + row]) * weights[i] / steps[k]
        scaled = (values[i] - modelled) * weights[i] + derivative[ratio] * far
        residual[i] = scaled
        chi2 += scaled * scaled
        for k in range(count):
            slope[k] += derivative[k] * scaled
            for m in range(k + 1):
                normal[k, m] += derivative[k] * derivative[m]
    for k in range(count):
        for m in range(k):
            normal[m, k] = normal[k, m]
    if len(disturbances):
        products = np.zeros((len(disturbances), count))
        for i in range(size):
            model, row, blocks = (force, i, split) if i < split else (position, i - split, size - split)
            for k in range(count):
                slanted = (model[row] - model[(k + 1) * blocks + row]) * weights[i] / steps[k]
                for d in range(len(disturbances)):
                    products[d, k] += disturbances[d, i] * slanted
        inverse = np.linalg.inv(disturbances @ disturbances.T + np.eye(len(disturbances)))
        along = disturbances @ residual
        sizes = inverse @ along
        normal = normal - products.T @ (inverse @ products)
        slope = slope - products.T @ sizes
        residual = residual - disturbances.T @ sizes
        chi2 -= float(along @ sizes)
    return residual, normal, slope, chi2


@compiled
def add_bends(curves: Samples, times: Samples, spread: Samples) -> None:
    """Make means over blocks of curves at the blocks' mean times, in place.

    The mean of a curve f is f + f'' s / 2 where the samples of a block scatter by a variance s about their
    mean time. f'' is that of the parabola through the value and its neighbours, limited to twice those next
    to it; 0 where these differ in sign, as beside a jump, and at the ends.

    Parameters
    ----------
    curves : ndarray, shape (c n,)
        One after the other, so near to each other that all bend as the first does.
    times, spread : ndarray, shape (n,)
        Mean time of each block [s], and s [s²].
    """
    if not spread.any():
        return
    size, before, bend, rate = len(times), 0.0, 0.0, 0.0
    bends = np.zeros(size)
    for i in range(1, size):
        next_rate = (curves[i] - curves[i - 1]) / (times[i] - times[i - 1])
        after = (next_rate - rate) / (times[i] - times[max(i - 2, 0)])
        if i > 3 and before * bend > 0.0 and bend * after > 0.0:
            largest = 2.0 * min(abs(before), abs(after))
            bends[i - 2] = spread[i - 2] * min(max(bend, -largest), largest)
        before, bend, rate = bend, after, next_rate
    for first in range(0, len(curves), size):
        for i in range(size):
            curves[first + i] += bends[i]


@compiled
def rates_of_change(times: Samples, values: Samples) -> Samples:
    """Give the derivative, shape (n,), of the parabola through each value and its two neighbours.

    At the ends it is that of the straight line to the one neighbour; 0 of a single value.
    """
    rates = np.zeros_like(values)
    before, behind = 0.0, 0.0
    for i in range(len(values) - 1):
        after = times[i + 1] - times[i]
        ahead = (values[i + 1] - values[i]) / after
        rates[i] = (behind * after + ahead * before) / (before + after) if i else ahead
        before, behind = after, ahead
    rates[-1:] = behind
    return rates


@compiled
def sample_squares(
    times: Samples,
    model: Samples,
    residual: Samples,
    weights: Samples,
    sums: tuple[Samples, Samples, Samples, Samples, float],
) -> tuple[float, float]:
    """Sum of squares of single samples over their noise, and their number, blocks about a jump left out.

    The model's slope in a block comes from its neighbours, limited to twice the smaller one-sided slope,
    and 0 where these differ in sign: beside a jump it is that of this side. `weights` are one over the std of
    each block; those about a jump are known by their widened std. `sums` are the fields of `WithinBlockSums`.
    """
    count, tt, yy, ty, noise_std = sums
    last = len(model) - 1
    total, counted = 0.0, 0.0
    for i in range(last + 1):
        if not weights[i] * noise_std > 0.5 * math.sqrt(count[i]):  # its std is not noise_std / sqrt(count)
            continue
        before, after = max(i - 1, 0), min(i + 1, last)
        slope_before = (model[before + 1] - model[before]) / (times[before + 1] - times[before])
        slope_after = (model[after] - model[after - 1]) / (times[after] - times[after - 1])
        central = (model[after] - model[before]) / (times[after] - times[before])
        steepest = 2.0 * min(abs(slope_before), abs(slope_after))
        slope = min(max(central, -steepest), steepest) if slope_before * slope_after > 0.0 else 0.0
        within = yy[i] - 2.0 * slope * ty[i] + slope * slope * tt[i]
        total += residual[i] * residual[i] + within / noise_std**2
        counted += count[i]
    return total, counted
