"""B-splines along a slide, integrated twice over time: what each coefficient does to the position."""

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import Samples

MIN_INTEGRATION_STEPS = 300
"""Steps of the double integral over a slide, at least. Our choice."""


@compiled
def information(
    t: Samples,
    x: Samples,
    moved: Samples,
    variance: float,
    grid: Samples,
    gravity: float,
) -> tuple[Samples, Samples, float, int]:
    """Give the fields of a `friction_profile.SplineInformation`."""
    points, first = len(grid), grid[0]
    spacing = grid[1] - first
    columns = _columns(t, x, first, spacing, points, gravity)
    columns[:, -1] -= moved
    _remove_line(t, columns)
    coefficients = columns.shape[1] - 1
    products = columns.T @ columns
    matrix, vector = np.zeros((points + 2, points + 2)), np.zeros(points + 2)
    for i in range(coefficients):
        vector[i] = products[i, coefficients] / variance
        for j in range(i + 1):
            matrix[i, j] = matrix[j, i] = products[i, j] / variance
    return matrix, vector, x[-1], coefficients


@compiled
def _columns(t: Samples, x: Samples, first: float, spacing: float, points: int, gravity: float) -> Samples:
    """Columns of the coefficients met, and position last, at the blocks, shape (n, s + 1).

    Every B-spline is integrated twice along the path: trapezium, then the exact second integral of it.
    x_0 and v_0 are integrated out, which projects the columns 1 and t away; so the integrals may start
    anywhere.
    """
    n, furthest = len(t), 0.0
    for k in range(n):
        furthest = max(furthest, (x[k] - first) / spacing)
    coefficients = min(int(furthest), points - 2) + 4
    columns = np.empty((n, coefficients + 1))
    speed, place = np.zeros(coefficients), np.zeros(coefficients)
    before, now = np.empty(4), np.empty(4)
    parts = max(1, MIN_INTEGRATION_STEPS // n)
    cell = _splines(x[0], first, spacing, points, before)
    for k in range(n):
        if k > 0:
            step = (t[k] - t[k - 1]) / parts
            for part in range(parts):
                # between blocks the path bends by less than a micrometre, which friction does not notice
                at = x[k - 1] + (x[k] - x[k - 1]) * (part + 1.0) / parts
                other = _splines(at, first, spacing, points, now)
                for i in range(coefficients):
                    place[i] += step * speed[i]
                for i in range(4):
                    place[cell + i] += step**2 / 3.0 * before[i]
                    speed[cell + i] += step / 2.0 * before[i]
                    place[other + i] += step**2 / 6.0 * now[i]
                    speed[other + i] += step / 2.0 * now[i]
                    before[i] = now[i]
                cell = other
        for i in range(coefficients):
            columns[k, i] = -gravity * place[i]
        columns[k, coefficients] = x[k]
    return columns


@compiled
def _splines(x: float, first: float, spacing: float, points: int, out: Samples) -> int:
    """Values of the four B-splines that are not zero at a place; gives the first of them."""
    place = min(max((x - first) / spacing, 0.0), points - 1.0)
    cell = min(int(place), points - 2)
    u = place - cell
    out[0] = (1.0 - u) ** 3 / 6.0
    out[1] = (3.0 * u**3 - 6.0 * u**2 + 4.0) / 6.0
    out[2] = (-3.0 * u**3 + 3.0 * u**2 + 3.0 * u + 1.0) / 6.0
    out[3] = u**3 / 6.0
    return cell


@compiled
def _remove_line(t: Samples, columns: Samples) -> None:
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
