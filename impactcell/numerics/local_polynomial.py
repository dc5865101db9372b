"""Polynomials through stretches of samples, and running means: every capture needs many of them.

A polynomial of degree p through values y at times t is fitted in u = (t - origin) / scale by its normal
equations, sum_i u_i^(j+k) c_k = sum_i u_i^j y_i, solved by Cholesky's factor L. With |u| <= 1 and p <= 3 they
lose at most some five digits of sixteen, which noise does not see.
"""

import math

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import Samples

GROWTH = 1.3
"""Factor by which windows grow: finer steps cost more fits and find the same maximum. Our choice."""
MAX_WINDOWS = 64
"""Windows tried at most: `GROWTH` to this power is 2e7."""


@compiled
def channel_statistics(times: Samples, values: Samples) -> tuple[int, bool, float, float, int]:
    """Look through a channel once.

    Returns
    -------
    bad : int
        Samples that are not numbers.
    ascending : bool
        Whether times increase.
    lowest, highest : float
    plateau : int
        The most values in a row that stand exactly at the highest.
    """
    bad, ascending = 0, True
    lowest, highest = np.inf, -np.inf
    plateau, run, latest = 0, 0, 0
    before = -np.inf
    for i in range(len(values)):
        time, value = times[i], values[i]
        if not math.isfinite(time + value):
            bad += 1
        if not time > before:
            ascending = False
        before = time
        lowest = min(lowest, value)
        if value >= highest:
            run = run + 1 if value == highest and latest == i - 1 else 1
            plateau = run if value > highest else max(plateau, run)
            highest, latest = value, i
    return bad, ascending, lowest, highest, plateau


@compiled
def running_mean(values: Samples, width: int) -> Samples:
    """Mean of `width` values about each, fewer at the ends."""
    n = len(values)
    before = width // 2
    after = width - before
    sums = np.empty(n + 1)
    sums[0] = 0.0
    for i in range(n):
        sums[i + 1] = sums[i] + values[i]
    mean = np.empty(n)
    for i in range(n):
        if before <= i <= n - after:
            mean[i] = (sums[i + after] - sums[i - before]) / width
        else:
            first, last = max(i - before, 0), min(i + after, n)
            mean[i] = (sums[last] - sums[first]) / (last - first)
    return mean


def mean(values: Samples) -> float:
    """Give numpy's mean of a few values, in less time."""
    return float(np.add.reduce(values)) / len(values)


def median(values: Samples) -> float:
    """Give numpy's median of a few values, in less time."""
    ordered, half = values.copy(), len(values) // 2
    ordered.sort()
    return float(ordered[half] if len(values) % 2 else 0.5 * (ordered[half - 1] + ordered[half]))


@compiled
def median_third_difference(values: Samples) -> float:
    """Median of the absolute third differences of four values and more, by quickselect (Hoare 1961)."""
    n = len(values) - 3
    absolute = np.empty(n)
    for i in range(n):
        first, second = values[i + 1] - values[i], values[i + 2] - values[i + 1]
        third = values[i + 3] - values[i + 2]
        absolute[i] = abs((third - second) - (second - first))
    half, low, high = n // 2, 0, n - 1
    while low < high:
        pivot = absolute[(low + high) // 2]
        i, j = low, high
        while i <= j:
            while absolute[i] < pivot:
                i += 1
            while absolute[j] > pivot:
                j -= 1
            if i <= j:
                absolute[i], absolute[j] = absolute[j], absolute[i]
                i += 1
                j -= 1
        if half <= j:
            high = j
        elif half >= i:
            low = i
        else:
            break
    if n % 2:
        return float(absolute[half])
    return float(0.5 * (np.max(absolute[:half]) + absolute[half]))


@compiled
def fit_polynomial(
    times: Samples, values: Samples, origin_s: float, scale_s: float, degree: int
) -> tuple[Samples, Samples, float]:
    """Fit a polynomial of at most third degree in u = (t - origin) / scale.

    Returns
    -------
    coefficients : ndarray, shape (degree + 1,)
        Lowest power first; nan where the samples do not determine them.
    factor : ndarray, shape (degree + 1, degree + 1)
        Cholesky's factor L of the normal equations, for `value_std`.
    squares : float
        Sum of squares of the residuals.
    """
    size = degree + 1
    power, moments = np.zeros(7), np.zeros(4)
    base, total = values[0], 0.0  # taken off first: what is left is small, and so are its squares' errors
    for i in range(len(times)):
        u = (times[i] - origin_s) / scale_s
        y = values[i] - base
        u2 = u * u
        u3 = u2 * u
        power[0] += 1.0
        power[1] += u
        power[2] += u2
        power[3] += u3
        power[4] += u2 * u2
        power[5] += u2 * u3
        power[6] += u3 * u3
        moments[0] += y
        moments[1] += u * y
        moments[2] += u2 * y
        moments[3] += u3 * y
        total += y * y
    factor = np.zeros((size, size))
    for j in range(size):
        for k in range(j + 1):
            pivot = power[j + k]
            for m in range(k):
                pivot -= factor[j, m] * factor[k, m]
            factor[j, k] = math.sqrt(pivot) if j == k else pivot / factor[k, k]
    coefficients = moments[:size].copy()
    for j in range(size):
        for k in range(j):
            coefficients[j] -= factor[j, k] * coefficients[k]
        coefficients[j] /= factor[j, j]
        total -= coefficients[j] * coefficients[j]
    for j in range(size - 1, -1, -1):
        for k in range(j + 1, size):
            coefficients[j] -= factor[k, j] * coefficients[k]
        coefficients[j] /= factor[j, j]
    coefficients[0] += base
    return coefficients, factor, max(total, 0.0)


@compiled
def value_std(factor: Samples, u: float) -> float:
    """Give the standard deviation of the polynomial's value at `u`, in those of one sample."""
    size = len(factor)
    column = np.empty(size)
    power, total = 1.0, 0.0
    for j in range(size):
        column[j] = power
        for k in range(j):
            column[j] -= factor[j, k] * column[k]
        column[j] /= factor[j, j]
        total += column[j] * column[j]
        power *= u
    return math.sqrt(total)


@compiled
def value_at(coefficients: Samples, u: float) -> float:
    """Value of a polynomial, its coefficients lowest power first."""
    value = 0.0
    for j in range(len(coefficients) - 1, -1, -1):
        value = value * u + coefficients[j]
    return value


@compiled
def _argmax(cubic: Samples, low: float, high: float) -> float:
    """Where a cubic is largest between two ends."""
    best = low if value_at(cubic, low) > value_at(cubic, high) else high
    # The zero of the derivative c1 + 2 c2 u + 3 c3 u² at which the second derivative is negative.
    c1, c2, c3 = cubic[1], cubic[2], cubic[3]
    inside = c2 * c2 - 3.0 * c1 * c3
    if inside > 0.0:
        root = math.sqrt(inside)
        u = c1 / (root - c2) if c2 < 0.0 else (-c2 - root) / (3.0 * c3) if c3 != 0.0 else low
        if low < u < high and value_at(cubic, u) > value_at(cubic, best):
            best = u
    return best


@compiled
def widest_cubic(
    times: Samples,
    values: Samples,
    sigma: float,
    start: tuple[float, float, float],
    widths_s: tuple[float, float, float],
) -> tuple[bool, float, float]:
    """Maximum of a cubic over the widest window about `at_s` in which its residuals are noise.

    Lepski's rule: windows grow until the residuals, or the maximum against those of narrower windows, show
    more than noise. A window reaches `left` and `right` of its half width to either side of its centre, which
    follows the maximum where both are 1.

    Parameters
    ----------
    times, values : ndarray, shape (n,)
    sigma : float
        Noise of one sample.
    start : tuple of float
        Time of the first centre, `left` and `right`.
    widths_s : tuple of float
        Narrowest and widest half width, and the time between samples.

    Returns
    -------
    is_fitted : bool
    value, std : float
        The maximum and its standard deviation.
    """
    (at_s, left, right), (narrowest_s, widest_s, step_s) = start, widths_s
    is_fitted, value, std = False, np.nan, np.nan
    highest, lowest = np.inf, -np.inf
    half, centre = narrowest_s, at_s
    for _ in range(MAX_WINDOWS):
        if half > widest_s and is_fitted:
            break
        first = np.searchsorted(times, centre - left * half - 0.01 * step_s)
        last = np.searchsorted(times, centre + right * half + 0.01 * step_s, side="right")
        if last - first < 6:
            half *= GROWTH
            if half > 4.0 * widest_s:
                break
            continue
        cubic, factor, squares = fit_polynomial(times[first:last], values[first:last], centre, half, 3)
        freedom = last - first - 4
        if not squares / sigma**2 <= freedom + 3.0 * math.sqrt(2.0 * freedom):
            break
        u = _argmax(cubic, (times[first] - centre) / half, (times[last - 1] - centre) / half)
        top = value_at(cubic, u)
        if top > highest or top < lowest:
            break
        is_fitted, value, std = True, top, sigma * value_std(factor, u)
        highest, lowest = min(highest, top + 2.0 * std), max(lowest, top - 2.0 * std)
        if left == 1.0 and right == 1.0:
            centre = min(max(centre + half * u, at_s - half), at_s + half)
        half *= GROWTH
    return is_fitted, value, std
