"""Waves among the laws: the one that a spline follows is found by itself, whatever the likelihood near by."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.discrepancy.laws.condense import Tangent, rank_forms
from impactcell.discrepancy.laws.grammar import WAVES
from impactcell.physics.bspline import spline_basis
from impactcell.physics.free_forms import FINE_SPANS, FINER, FREE_FORMS


def tangent_of(values: np.ndarray, u: np.ndarray, lower: float, upper: float) -> Tangent:
    """Likelihood of which next to nothing is known, about the spline nearest to given values."""
    fitted = np.linalg.lstsq(spline_basis(u, lower, upper, FINE_SPANS), values)[0]
    count = FINE_SPANS + 3
    information = 1e-6 * np.eye(count)
    return Tangent(
        information,
        information @ fitted,
        lower,
        upper,
        1000,
        False,
        fitted,
        np.zeros(2),
        np.zeros((2, count)),
    )


@pytest.mark.slow
@settings(max_examples=3)
@given(cycles=st.floats(2.0, 22.0), phase=st.floats(0.0, 2.0 * math.pi), amplitude=st.floats(0.01, 1.0))
def test_a_wave_of_up_to_two_dozen_is_found(cycles: float, phase: float, amplitude: float) -> None:
    lower, upper = -0.012, 0.013
    u = np.linspace(lower, upper, 900)
    period = (upper - lower) / cycles
    values = amplitude * np.sin(2.0 * math.pi * u / period + phase)
    waves = [
        item
        for item in rank_forms(tangent_of(values, u, lower, upper))
        if {term[0].name for term in item.form} == set(WAVES) and item.terms[0].shapes == item.terms[1].shapes
    ]
    periods = [item.terms[0].shapes[0][0] for item in waves]
    sizes = [math.hypot(*item.amplitudes) for item in waves]
    assert min(abs(found / period - 1.0) for found in periods) < 0.03
    assert min(abs(found / amplitude - 1.0) for found in sizes) < 0.05


def test_more_pieces_are_of_the_same_place() -> None:
    assert FINER
    for place, finer in FINER.items():
        coarse = FREE_FORMS[place]
        assert finer.place == coarse.place == place
        assert finer.spans > coarse.spans
        assert finer.effect.equation == coarse.effect.equation


@pytest.mark.parametrize("pair", [("u", "u^3")])
def test_a_sum_of_two_powers_is_found_by_its_numbers(pair: tuple[str, str]) -> None:
    """Where the data know the function well, the sum explains all of it, and one power alone does not."""
    lower, upper, count = 0.0, 1.0, FINE_SPANS + 3
    u = np.linspace(lower, upper, 900)
    powers = {"1": np.ones_like(u), "u": u, "u^2": u**2, "u^3": u**3}
    basis = spline_basis(u, lower, upper, FINE_SPANS)
    fitted = np.linalg.lstsq(basis, 0.7 * powers[pair[0]] + 0.4 * powers[pair[1]])[0]
    information = 1e4 * basis.T @ basis
    known = Tangent(
        information, information @ fitted, lower, upper, 900, True, fitted, np.zeros(2), np.zeros((2, count))
    )
    best = rank_forms(known)[0]
    assert best.gain == pytest.approx(known.most, rel=1e-6)
    assert best.score == pytest.approx(known.most - 0.5 * 2 * math.log(900), rel=1e-6)
    assert sorted(best.amplitudes) == pytest.approx([0.4, 0.7], rel=1e-4)
