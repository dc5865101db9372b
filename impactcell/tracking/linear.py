"""Small symmetric problems straight through LAPACK: for matrices of tens of rows all else costs more."""

import numpy as np
from scipy.linalg import lapack

from impactcell.records import Samples


def solved(matrix: Samples, right: Samples) -> Samples:
    """Solve for a symmetric positive definite matrix; the least solution where rounding says it is not."""
    _, found, info = lapack.dposv(matrix, right)
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=1e-14)[0] if info else found)


def eigen(matrix: Samples) -> tuple[Samples, Samples]:
    """Eigenvalues of a symmetric matrix in ascending order, and its eigenvectors as columns."""
    values, vectors, info = lapack.dsyevd(matrix)
    if info:
        raise np.linalg.LinAlgError("the eigenvalues of a symmetric matrix did not converge")
    return values, vectors


def both_diagonal(first: Samples, second: Samples) -> tuple[Samples, Samples]:
    """Values e and columns V with V' second V = 1, V' first V = diag(e); `second` positive definite."""
    values, vectors, info = lapack.dsygvd(first, second)
    if info:
        raise np.linalg.LinAlgError(
            "two symmetric matrices have no common axes: one is not positive definite"
        )
    return values, vectors
