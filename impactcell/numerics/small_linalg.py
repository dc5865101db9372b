"""Small symmetric problems, compiled: for tens of rows a library call costs more than the work."""

import math

import numpy as np

from impactcell.numerics.jit import compiled
from impactcell.records import Samples

ROUNDING = 1e-14
"""What is left of a diagonal element below this share of it is rounding: fifty units in the last place."""


@compiled
def cholesky(matrix: Samples) -> Samples:
    """Lower Cholesky factor of a positive semidefinite matrix.

    A pivot of which only rounding is left is infinite: its unknown is solved as zero.
    """
    n = len(matrix)
    lower = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            pivot = matrix[i, j]
            for k in range(j):
                pivot -= lower[i, k] * lower[j, k]
            if i == j:
                lower[i, i] = math.sqrt(pivot) if pivot > ROUNDING * matrix[i, i] else math.inf
            else:
                lower[i, j] = pivot / lower[j, j]
    return lower


@compiled
def block(matrix: Samples, top: int, bottom: int, left: int, right: int) -> Samples:
    """Copy of the rows `top` .. `bottom` - 1 in the columns `left` .. `right` - 1."""
    copy = np.empty((bottom - top, right - left))
    for i in range(bottom - top):
        for j in range(right - left):
            copy[i, j] = matrix[top + i, left + j]
    return copy


@compiled
def transposed_product(A: Samples, B: Samples) -> Samples:
    """Give A' B, shapes (k, n) and (k, m)."""
    product = np.zeros((A.shape[1], B.shape[1]))
    for k in range(len(A)):
        for i in range(A.shape[1]):
            for j in range(B.shape[1]):
                product[i, j] += A[k, i] * B[k, j]
    return product


@compiled
def unpack_triangle(triangle: Samples) -> Samples:
    """Symmetric matrix of its lower triangle by rows, which is what is kept of one between cycles."""
    n, p = int(math.sqrt(2.0 * len(triangle))), 0
    matrix = np.empty((n, n))
    for i in range(n):
        for j in range(i + 1):
            matrix[i, j] = matrix[j, i] = triangle[p]
            p += 1
    return matrix


@compiled
def solve_lower(lower: Samples, right: Samples) -> Samples:
    """Solve L X = R, shapes (n, n) and (n, k)."""
    n, width = right.shape
    solution = right.copy()
    for i in range(n):
        for k in range(i):
            factor = lower[i, k]
            for c in range(width):
                solution[i, c] -= factor * solution[k, c]
        for c in range(width):
            solution[i, c] /= lower[i, i]
    return solution


@compiled
def solve_upper(lower: Samples, right: Samples) -> Samples:
    """Solve L' X = R, shapes (n, n) and (n, k)."""
    n, width = right.shape
    solution = right.copy()
    for i in range(n - 1, -1, -1):
        for c in range(width):
            solution[i, c] /= lower[i, i]
        for k in range(i):
            factor = lower[i, k]
            for c in range(width):
                solution[k, c] -= factor * solution[i, c]
    return solution


@compiled
def solve(matrix: Samples, right: Samples) -> Samples:
    """Solve M x = r for a symmetric positive definite matrix, shapes (n, n) and (n,)."""
    lower = cholesky(matrix)
    return solve_upper(lower, solve_lower(lower, right.reshape((len(right), 1)))).reshape(len(right))


@compiled
def inverse(matrix: Samples) -> Samples:
    """Inverse of a symmetric positive definite matrix."""
    lower = cholesky(matrix)
    return solve_upper(lower, solve_lower(lower, np.eye(len(matrix))))


@compiled
def marginalise(
    matrix: Samples, vector: Samples, inner: Samples, cross: Samples, inner_vector: Samples
) -> tuple[Samples, Samples]:
    """Information on some unknowns, with the others integrated out.

    Parameters
    ----------
    matrix, vector : ndarray, shapes (n, n), (n,)
        Information on the unknowns kept.
    inner, cross, inner_vector : ndarray, shapes (k, k), (k, n), (k,)
        Information on the others, that which both share, and its vector.

    Returns
    -------
    marginal, marginal_vector : ndarray
        M - X' N^-1 X and h - X' N^-1 a.
    """
    n, k = len(vector), len(inner_vector)
    right = np.empty((k, n + 1))
    for c in range(k):
        for i in range(n):
            right[c, i] = cross[c, i]
        right[c, n] = inner_vector[c]
    whitened = solve_lower(cholesky(inner), right)
    marginal, marginal_vector = matrix.copy(), vector.copy()
    for c in range(k):
        for i in range(n):
            factor = whitened[c, i]
            marginal_vector[i] -= factor * whitened[c, n]
            for j in range(n):
                marginal[i, j] -= factor * whitened[c, j]
    return marginal, marginal_vector


@compiled
def with_random_effects(components: Samples, matrix: Samples, vector: Samples) -> tuple[Samples, Samples]:
    """Information (G^-1 + C C')^-1 and its vector: what is left of G when the unknowns vary by C.

    Shapes (n, k), (n, n) and (n,).
    """
    k = components.shape[1]
    cross, inner, inner_vector = transposed_product(components, matrix), np.eye(k), np.zeros(k)
    for c in range(k):
        for i in range(len(vector)):
            inner_vector[c] += components[i, c] * vector[i]
            for d in range(k):
                inner[c, d] += cross[c, i] * components[i, d]
    return marginalise(matrix, vector, inner, cross, inner_vector)
