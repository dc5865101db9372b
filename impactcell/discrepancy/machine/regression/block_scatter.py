"""Intervals of a regression by the scatter of its residuals between blocks.

Blocks that tell a number have a part in what was fitted, and leave too little: each block's scores are made
larger for that, which is unbiased where all scatter alike (Bell and McCaffrey 2002, CR2). Where few blocks
tell a number, few tell how much it scatters: Student's t has as many degrees of freedom as the estimated
variance then has (Satterthwaite 1946).
"""

import numpy as np
from scipy.stats import t as student

from impactcell.records import Samples

OWN_AT_MOST = 1.0 - 1e-6
"""Share of what is known of a number that one block may hold by itself [1]."""


def half_intervals(grams: Samples, scores: Samples, matrix: Samples, level: float = 0.95) -> Samples:
    """Half of the interval of each coefficient, shape (p,).

    Parameters
    ----------
    grams : ndarray, shape (b, p, p)
        Sums of products of the columns over each block.
    scores : ndarray, shape (b, p)
        Sums of products of the columns and what is left of the target.
    matrix : ndarray, shape (p, p)
        Normal equations: the sum of `grams`, with what is known beforehand.
    level : float
        Probability that an interval covers [1].
    """
    if not len(matrix):
        return np.empty(0)
    size = np.sqrt(np.where(np.diag(matrix) > 0.0, np.diag(matrix), 1.0))
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    told = values > values[-1] * len(values) * np.finfo(float).eps
    # In these coordinates the normal equations are the unit matrix.
    to_unit = vectors[:, told] / np.sqrt(values[told]) / size[:, None]
    shares, axes = np.linalg.eigh(to_unit.T @ grams @ to_unit)
    shares = np.clip(shares, 0.0, OWN_AT_MOST)
    larger = 1.0 / np.sqrt(1.0 - shares)
    along = to_unit @ axes
    parts = along @ (larger * np.einsum("bji,bj->bi", axes, scores @ to_unit))[:, :, None]
    variance = np.sum(parts[:, :, 0] ** 2, axis=0)
    # Variances of these parts, and what they have in common by the coefficients that were fitted.
    own = np.einsum("bci,bi->cb", along**2, shares * larger**2)
    common = np.einsum("bji,bci->cbj", axes, along * (shares * larger)[:, None])
    squares = np.sum(common**2, axis=2)
    trace = np.sum(own - squares, axis=1)
    crossed = np.swapaxes(common, 1, 2) @ common
    spread = np.sum(own**2 - 2.0 * own * squares, axis=1) + np.sum(crossed**2, axis=(1, 2))
    freedom = np.maximum(trace**2 / np.maximum(spread, np.finfo(float).tiny), 1.0)
    half: Samples = student.ppf(0.5 + 0.5 * level, freedom) * np.sqrt(variance)
    return half
