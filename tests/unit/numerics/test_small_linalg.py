"""Small compiled algebra against numpy's."""

import numpy as np
import pytest

from impactcell.numerics import small_linalg

RNG = np.random.default_rng(4)
ROOT = RNG.normal(size=(9, 9))
MATRIX = ROOT @ ROOT.T
VECTOR = RNG.normal(size=9)


def test_solution_of_a_definite_matrix():
    assert small_linalg.solve(MATRIX, VECTOR) == pytest.approx(np.linalg.solve(MATRIX, VECTOR), rel=1e-9)


def test_an_unknown_of_which_nothing_is_known_is_zero():
    matrix = MATRIX.copy()
    matrix[4] = matrix[:, 4] = 0.0
    others = np.arange(9) != 4
    found = small_linalg.solve(matrix, VECTOR)
    assert found[4] == 0.0
    expected = np.linalg.solve(MATRIX[np.ix_(others, others)], VECTOR[others])
    assert found[others] == pytest.approx(expected, rel=1e-9)


def test_integrating_unknowns_out_leaves_the_marginal_of_a_normal_distribution():
    kept, rest = slice(0, 5), slice(5, 9)
    information, vector = small_linalg.marginalise(
        MATRIX[kept, kept].copy(),
        VECTOR[kept].copy(),
        MATRIX[rest, rest].copy(),
        MATRIX[rest, kept].copy(),
        VECTOR[rest].copy(),
    )
    covariance, mean = np.linalg.inv(MATRIX), np.linalg.solve(MATRIX, VECTOR)
    assert np.linalg.inv(information) == pytest.approx(covariance[kept, kept], rel=1e-7)
    assert np.linalg.solve(information, vector) == pytest.approx(mean[kept], rel=1e-7)


def test_unknowns_that_vary_are_known_less():
    components = RNG.normal(size=(9, 3))
    information, vector = small_linalg.with_random_effects(components, MATRIX, VECTOR)
    expected = np.linalg.inv(np.linalg.inv(MATRIX) + components @ components.T)
    assert information == pytest.approx(expected, rel=1e-7)
    assert vector == pytest.approx(expected @ np.linalg.solve(MATRIX, VECTOR), rel=1e-7)


def test_a_triangle_holds_all_of_a_symmetric_matrix():
    lower = np.tril(MATRIX)
    assert (
        small_linalg.unpack_triangle(lower[np.tril_indices(9)]).tolist()
        == (lower + np.tril(lower, -1).T).tolist()
    )
    for n in range(60):
        assert small_linalg.unpack_triangle(np.zeros(n * (n + 1) // 2)).shape == (n, n)


def test_products_inverses_and_parts():
    other = RNG.normal(size=(9, 4))
    assert small_linalg.transposed_product(MATRIX, other) == pytest.approx(MATRIX.T @ other)
    assert small_linalg.inverse(MATRIX) == pytest.approx(np.linalg.inv(MATRIX), rel=1e-7)
    assert small_linalg.block(MATRIX, 2, 7, 1, 4).tolist() == MATRIX[2:7, 1:4].tolist()
