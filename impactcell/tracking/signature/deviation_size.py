"""How large the likeliest shape of a deviant cycle is, and how well that is known.

Of a shape s of unit size in friction the cycle says a = s' u / s' P s with variance v = scale / s' P s, and
its likelihood with the size left free is w = exp(a^2 / 2 v); `P` and `u` are those of
`deviation_test`. Place, width and steepness of a bump, or the wave of a ripple, are not known
either. With all of them held as likely as one another beforehand, the law of total variance gives::

    size = E_w a,    std^2 = E_w v + Var_w a

A bump of half width b at half of its height is exp(-log(2) |x / b|^q), q = 2 a bell and 8 nearly a box. A
ripple's cosine and sine are both free; its size is the amplitude, which has no sign. The sums go over even
steps of place and width, first over all of them and then twice over what is left likely: large deviations
are placed closer than the shapes lie that the scan looks at.

The std holds the noise of the sensors, the usual variation between cycles and the error of the learned mean
(all three in P), what was not learned of the variation (in the scale), and what is not known of the shape
within its family; not that it may be of another family, nor that only cycles which stand out are reported.
Error over std of deviant cycles, told as the right family, has itself a standard deviation of 0.92 for bells,
1.00 for cosine windows, 0.96 for boxes, 1.11 for ripples, 0.93 for levels and 1.04 for tilts of any place,
width and amplitude (`make bench ARGS=tracking`, table "Size of a deviation"); at the likeliest place and
width alone it would be 3.3, 3.3, 10 and 1.9 for the first four.
"""

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from impactcell.records import Samples
from impactcell.tracking.signature import deviation_shapes, friction_profile, matched_filter_scan

LEVEL, TILT, BUMP, RIPPLE = map(matched_filter_scan.FAMILIES.index, ("level", "tilt", "bump", "ripple"))
"""Numbers of the families."""
HALF_WIDTH_OF_BELL = math.sqrt(2.0 * math.log(2.0))
"""Half width of a bell at half of its height, over its standard deviation."""
ROUNDS = 3
"""Rounds of sums, each over what the one before left likely. Our choice."""
REFINED_STEPS = 7
"""Steps in place, width or wave, of every round but the first. Our choice."""
REFINED_REACH_STD = 3.5
"""Standard deviations that a round goes to either side of what the one before it found: all but 5e-4."""
MAX_EXPONENT = 50.0
"""|x / b|^q beyond which a bump is nothing: 2^-50 is rounding."""
MIN_INFORMATION = 1e-30
"""Information on a size, in 1 over friction squared, below which it is none; keeps a quotient finite."""
UNSEEN = (0.0, math.inf)
"""Size and standard deviation of what cannot be seen."""

ShapeScores = tuple[Samples, Samples, Samples, Samples]
"""Of shapes at a noise of one: information on their sizes, scores squared, sizes, and variances of those."""


def estimate_size(
    family: int, P: Samples, u: Samples, grid_m: Samples, reached_m: float, least: float, scale: float
) -> tuple[float, float]:
    """Size of the shape of one family in one cycle, and its standard deviation.

    Parameters
    ----------
    family : int
        Number in `matched_filter_scan.FAMILIES`.
    P, u : ndarray, shapes (s, s), (s,)
        Information and scores of the coefficients that were seen.
    reached_m : float
        How far the part slid.
    least : float
        Information on its size that a shape must have to be looked for.
    scale : float
        Variance of a score of a normal cycle.

    Returns
    -------
    size, std : float
        Friction; of a tilt, from one end of the grid to the other.
    """
    across = friction_profile.shape_coefficients(len(grid_m))[:, : len(u)]
    K, v = across @ P @ across.T, across @ u
    length, spacing = float(grid_m[-1]), float(grid_m[1] - grid_m[0])
    if family == BUMP:
        low = np.array([0.0, math.log(deviation_shapes.BUMP_WIDTHS_M[0])])
        high = np.array([min(reached_m, length), math.log(deviation_shapes.BUMP_WIDTHS_M[-1])])
        steps = int(high[0] / spacing) + 2, len(deviation_shapes.BUMP_WIDTHS_M)
        return _average_over_shapes(lambda at: _bumps(K, v, grid_m, at), low, high, steps, least, scale)
    if family == RIPPLE:
        low = np.array([max(1.0, length / reached_m)])  # waves on the grid
        high = low.copy()
        high[0] = max(high[0], length / max(4.0 * spacing, deviation_shapes.MIN_WAVE_M))
        waves = int(4.0 * (high[0] - low[0])) + 2
        return _average_over_shapes(lambda at: _ripples(K, v, grid_m, at), low, high, (waves,), least, scale)
    return _level_or_tilt(family, K, v, grid_m, least, scale)


def _level_or_tilt(
    family: int, K: Samples, v: Samples, grid: Samples, least: float, scale: float
) -> tuple[float, float]:
    """Size of the level alone, or of the tilt with the level free, as the scan looks for them."""
    image, slope = K.sum(axis=0), grid / grid[-1]
    information, score = float(image.sum()), float(v.sum())
    if family == TILT and information > 0.0:
        turn = float(slope @ image) / information
        score = float(slope @ v) - turn * score
        information = float(slope @ K @ slope) - turn * turn * information
    return (score / information, math.sqrt(scale / information)) if information >= least else UNSEEN


def _average_over_shapes(
    score_shapes: Callable[[Samples], ShapeScores],
    low: Samples,
    high: Samples,
    steps: tuple[int, ...],
    least: float,
    scale: float,
) -> tuple[float, float]:
    """Size and standard deviation from all shapes between `low` and `high`, shapes (d,).

    `score_shapes` is given shapes as rows, shape (n, d), and answers for n of them or for n of each of
    several kinds.
    """
    first, last, size, std = low, high, 0.0, 0.0
    for _ in range(ROUNDS):
        at = first + (last - first) * _lattice(steps)
        information, squared, sizes, variances = score_shapes(at)
        gain = np.where(information >= least, squared / (2.0 * scale), -math.inf)
        highest_gain = gain.max()
        if highest_gain == -math.inf:
            return UNSEEN
        weight = np.exp(gain - highest_gain)
        weight /= weight.sum()
        size = float(np.vdot(weight, sizes))
        std = math.sqrt(np.vdot(weight, scale * variances + (sizes - size) ** 2))
        likely = weight.reshape(-1, len(at)).sum(axis=0)
        middle = likely @ at
        step = (last - first) / (np.array(steps) - 1)
        # likely places between two steps have spread of their own, which the steps do not show
        spread = np.sqrt(likely @ (at - middle) ** 2 + step**2 / 16.0)
        first, last = (
            np.maximum(low, middle - REFINED_REACH_STD * spread),
            np.minimum(high, middle + REFINED_REACH_STD * spread),
        )
        steps = (REFINED_STEPS,) * len(steps)
    return size, std


@lru_cache(maxsize=64)
def _lattice(steps: tuple[int, ...]) -> Samples:
    """Points from 0 to 1 with so many steps a side, in rows."""
    axes = [np.linspace(0.0, 1.0, n) for n in steps]
    points: Samples = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(steps))
    return points


def _bumps(K: Samples, v: Samples, grid: Samples, at: Samples) -> ShapeScores:
    """Bumps at places and of logarithms of widths: the bells, then steeper ones, then the boxes."""
    off = np.abs(grid - at[:, :1]) / (HALF_WIDTH_OF_BELL * np.exp(at[:, 1:]))
    square = off * off
    powers = np.concatenate([square, square * off, (square * square) ** 2])
    rows = np.exp(-math.log(2.0) * np.minimum(powers, MAX_EXPONENT))
    information, score = np.maximum(np.einsum("ij,ij->i", rows @ K, rows), MIN_INFORMATION), rows @ v
    return information, score**2 / information, score / information, 1.0 / information


def _ripples(K: Samples, v: Samples, grid: Samples, at: Samples) -> ShapeScores:
    """Ripples of so many waves on the grid, known as well as at their worst phase, shape (n,) each."""
    phase = 2.0 * math.pi / grid[-1] * at * grid
    x, y = np.cos(phase), np.sin(phase)
    image, of_cosine, of_sine = x @ K, x @ v, y @ v
    cc, cs, ss = (image * x).sum(axis=1), (image * y).sum(axis=1), ((y @ K) * y).sum(axis=1)
    information = (cc + ss) / 2.0 - np.hypot((cc - ss) / 2.0, cs)
    solid = np.maximum(cc * ss - cs * cs, MIN_INFORMATION)
    a, b = (ss * of_cosine - cs * of_sine) / solid, (cc * of_sine - cs * of_cosine) / solid
    square = np.maximum(a * a + b * b, MIN_INFORMATION)
    variance = (ss * a * a - 2.0 * cs * a * b + cc * b * b) / (solid * square)
    return information, a * of_cosine + b * of_sine, np.sqrt(square), variance
