"""Laws that are the same at every value of their covariate."""

import numpy as np
import pytest

from impactcell.discrepancy.laws import grammar
from impactcell.discrepancy.laws.condense import rank_forms
from impactcell.discrepancy.laws.tangent import Tangent
from impactcell.physics.bspline import spline_basis
from impactcell.physics.free_forms import FREE_FORMS


def test_damping_that_is_the_same_at_every_indentation_is_a_constant() -> None:
    """Of a damper that pulls, too, the law was 1/(1+(u/l)^2), with l 46 times the range gone through."""
    low, high = 0.0, 0.69e-3
    basis = spline_basis(np.linspace(low, high, 400), low, high, 8)
    information = basis.T @ basis
    coefficients = np.full(11, 320.0)
    form = FREE_FORMS["free_damping_over_indentation"]
    quadratic = Tangent(
        information, information @ coefficients, low, high, 400, form.has_constant, coefficients,
        np.zeros(4), np.zeros((4, 11)),
    )  # fmt: skip
    best = rank_forms(quadratic)[0]
    assert grammar.name(best.form) == "1"
    assert best.amplitudes == pytest.approx((320.0,))
    assert not FREE_FORMS["free_stiffness_over_indentation"].has_constant  # that is k
