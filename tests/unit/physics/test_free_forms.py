"""Free-form terms: the spline against scipy's, and each place against a named effect that it can become."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from impactcell.errors import PhysicsError
from impactcell.physics import Ensemble, Plant, TapInput, simulate_tap
from impactcell.physics.bspline import spline, spline_basis
from impactcell.physics.effect import Effect
from impactcell.physics.effects import LIBRARY, add_effect, find_effect
from impactcell.physics.free_forms import FREE_FORMS, SPANS, SPANS_OF_TABLE
from impactcell.physics.remainder_forms import FILTERS, FORCE_FILTER, POSITION_FILTER, REMAINDER_FORMS

TIMES = np.linspace(1e-4, 0.02, 100)
TAP = TapInput(velocity_m_s=0.075, mass_kg=12.0, stroke_m=0.004, start_m=0.01)
LOWER, UPPER = 0.0, 0.2
COEFFICIENTS = SPANS + 3
GREVILLE = LOWER + (UPPER - LOWER) / SPANS * (np.arange(COEFFICIENTS) - 1.0)
"""Coefficients at which a cubic spline on uniform knots is the straight line u."""
GREVILLE_OF_TABLE = LOWER + (UPPER - LOWER) / SPANS_OF_TABLE * (np.arange(SPANS_OF_TABLE + 3) - 1.0)
"""The same for a function of the position."""


def _plant(effects: dict[str, dict[str, float]]) -> Plant:
    return Plant(6e5, 465.0, 0.2, 0.15, effects=effects)


def _free(identifier: str, values: np.ndarray, lower: float = LOWER, upper: float = UPPER) -> Plant:
    coefficients = {f"c{i}": float(value) for i, value in enumerate(values)}
    return _plant({identifier: {"lower": lower, "upper": upper, **coefficients}})


@pytest.mark.slow
@given(
    st.lists(st.floats(-10, 10), min_size=COEFFICIENTS, max_size=COEFFICIENTS),
    st.floats(0.0, 1.0),
    st.floats(0.0, 0.5),
)
def test_spline_is_scipys_inside_and_its_tangent_beyond(
    coefficients: list[float], share: float, beyond: float
) -> None:
    lower, upper = -0.3, 1.7
    knots = lower + (upper - lower) / SPANS * np.arange(-3, SPANS + 4)
    reference = BSpline(knots, np.array(coefficients), 3)
    p = np.array([lower, upper, *coefficients])
    u = lower + share * (upper - lower)
    assert spline(u, p, SPANS) == pytest.approx(float(reference(u)), abs=1e-12)
    assert float((spline_basis(u, lower, upper, SPANS) @ p[2:])[0]) == pytest.approx(
        float(reference(u)), abs=1e-12
    )
    tangent = float(reference(upper) + beyond * reference.derivative()(upper))
    assert spline(upper + beyond, p, SPANS) == pytest.approx(tangent, abs=1e-9)
    assert float((spline_basis(upper + beyond, lower, upper, SPANS) @ p[2:])[0]) == pytest.approx(
        tangent, abs=1e-9
    )


@pytest.mark.parametrize(
    ("identifier", "values", "effect"),
    [
        (
            "free_drag_over_speed",
            np.full(10, 60.0),
            {"viscous_friction": {"viscous_coefficient_n_s_per_m": 60.0}},
        ),
        (
            "free_drag_over_speed",
            900.0 * GREVILLE,
            {"quadratic_drag": {"drag_coefficient_n_s2_per_m2": 900.0}},
        ),
        (
            "free_force_over_position",
            -800.0 * GREVILLE_OF_TABLE,
            {"restoring_force": {"stiffness_n_per_m": 800.0}},
        ),
        (
            "free_friction_over_position",
            12.0 * GREVILLE_OF_TABLE,
            {"position_dependent_friction": {"gradient_per_m": 12.0}},
        ),
        (
            "free_damping_over_indentation",
            4e5 * GREVILLE,
            {"hunt_crossley_damping": {"damping_n_s_per_m2": 4e5}},
        ),
        ("free_reading_over_force", np.full(10, 0.03), {"force_sensor_gain": {"relative_error": 0.03}}),
        (
            "free_force_over_speed",
            -60.0 * GREVILLE,
            {"viscous_friction": {"viscous_coefficient_n_s_per_m": 60.0}},
        ),
    ],
)
def test_a_free_form_is_the_named_law_that_it_has_become(
    identifier: str, values: np.ndarray, effect: dict[str, dict[str, float]]
) -> None:
    times = np.linspace(0.0, 0.08, 400)
    free, named = simulate_tap(_free(identifier, values), TAP), simulate_tap(_plant(effect), TAP)
    assert free.peak_force_n == pytest.approx(named.peak_force_n, rel=1e-9)
    assert free.displacement_m == pytest.approx(named.displacement_m, rel=1e-8)
    np.testing.assert_allclose(free.sample(times).force_n, named.sample(times).force_n, rtol=1e-7, atol=1e-6)


def test_constant_stiffness_and_damping_are_the_plants_own() -> None:
    _are_alike("free_stiffness_over_indentation", np.full(10, 1e5), 1e5)


def test_a_force_that_grows_with_the_indentation_is_stiffness() -> None:
    _are_alike("free_force_over_indentation", 1e4 * GREVILLE, 1e4)


def _are_alike(identifier: str, values: np.ndarray, stiffness_n_per_m: float) -> None:
    stiffer = simulate_tap(_free(identifier, values), TAP)
    expected = simulate_tap(Plant(6e5 + stiffness_n_per_m, 465.0, 0.2, 0.15), TAP)
    assert stiffer.peak_force_n == pytest.approx(expected.peak_force_n, rel=1e-9)
    assert stiffer.displacement_m == pytest.approx(expected.displacement_m, rel=1e-9)


def test_friction_that_rises_with_speed_is_more_friction() -> None:
    level = simulate_tap(_free("free_friction_over_speed", np.full(10, 0.03)), TAP)
    expected = simulate_tap(Plant(6e5, 465.0, 0.2, 0.18), TAP)
    assert level.displacement_m == pytest.approx(expected.displacement_m, rel=1e-9)


def test_pull_of_a_straight_line_is_adhesion() -> None:
    free = _free("free_pull_over_gap", 4.0 * (1.0 - GREVILLE / UPPER), 0.0, 5e-4)
    named = _plant({"adhesion": {"force_n": 4.0, "range_m": 5e-4}})
    assert simulate_tap(free, TAP).displacement_m == pytest.approx(
        simulate_tap(named, TAP).displacement_m, rel=1e-9
    )


@pytest.mark.parametrize(
    ("filtered", "effect", "parameter"),
    [
        (FORCE_FILTER, "channel_skew", "delay_s"),
        (FORCE_FILTER, "force_sensor_lag", "time_constant_s"),
        (POSITION_FILTER, "channel_skew", "delay_s"),
        (POSITION_FILTER, "position_sensor_lag", "time_constant_s"),
    ],
)
def test_filter_of_a_channel_is_a_delay_and_a_lag(filtered: Effect, effect: str, parameter: str) -> None:
    values = {"delay_s": 0.0, "time_constant_s": 0.0, parameter: 4e-4}
    reading, expected = (
        Ensemble([TAP], (identifier,), force_time_s=[TIMES], position_time_s=[TIMES]).samples(
            np.array([6e5, 465.0, 0.2, 0.15, *numbers]), np.ones(1)
        )
        for identifier, numbers in (
            (filtered.identifier, values.values()),
            (effect, (values[parameter],)),
        )
    )
    assert reading == pytest.approx(expected, rel=1e-12)


def test_no_free_form_is_offered_as_an_effect() -> None:
    assert not set(FILTERS) & set(LIBRARY)
    assert set(FREE_FORMS) < set(REMAINDER_FORMS)
    assert not set(REMAINDER_FORMS) & set(LIBRARY)
    for identifier, form in REMAINDER_FORMS.items():
        assert find_effect(identifier) is form.effect


def test_two_effects_of_one_name_are_refused() -> None:
    form = next(iter(FREE_FORMS.values()))
    add_effect(form.effect)
    named = next(iter(LIBRARY.values()))
    with pytest.raises(PhysicsError, match="there already"):
        add_effect(replace(named, equation="another"))
    with pytest.raises(PhysicsError, match="no effect is called 'nothing'"):
        find_effect("nothing")
