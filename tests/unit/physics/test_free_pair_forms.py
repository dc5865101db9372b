"""Free-form terms of two covariates, and laws that read a column of `shots.csv`."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from impactcell.physics import Ensemble, Plant, TapInput, simulate_tap
from impactcell.physics.bspline import tensor_basis, tensor_spline
from impactcell.physics.effect_contract import contract_faults
from impactcell.physics.effects import LIBRARY, withdraw_effect
from impactcell.physics.free_form import ACROSS, FreeForm
from impactcell.physics.free_forms import SPANS
from impactcell.physics.free_motion import acts_on_speed, linear_resistance, model_acceleration
from impactcell.physics.free_pair_forms import FREE_PAIR_FORMS, column_pair_forms
from impactcell.physics.outside_effects import offer_effects
from impactcell.records import Capture

TIMES = np.linspace(1e-4, 0.02, 100)
TAP = TapInput(velocity_m_s=0.075, mass_kg=12.0, stroke_m=0.004, start_m=0.01)
COLUMN = "oil (°C)"
ENDS = ((0.0, 0.2), (15.0, 40.0))
ALONG = ENDS[0][0] + (ENDS[0][1] - ENDS[0][0]) / SPANS * (np.arange(SPANS + 3) - 1.0)
ACROSS_PLACES = ENDS[1][0] + (ENDS[1][1] - ENDS[1][0]) * (np.arange(ACROSS) - 1.0)
"""Coefficients at which a cubic spline on uniform knots is the straight line u, or w."""

OIL = '''
"""Viscous friction of an oil that gets thinner as it gets warmer."""

from impactcell.physics.effect import Effect, Kind, LawKind, Parameter, Phase


def drag(_x, v, _m, _g, p):
    """-k x' (40 - T) / 25."""
    return -p[0] * v * (40.0 - p[1]) / 25.0


EFFECT = Effect(
    identifier="thinning_oil",
    kind=Kind.BODY,
    equation="-k x' (40 - T) / 25",
    reference="a test",
    phases=(Phase.FREE_SLIDE,),
    parameters=(Parameter("k_n_s_per_m", "N s/m", null=0.0, lower=0.0, upper=500.0, typical=100.0),),
    laws={LawKind.BODY: drag},
    columns={"oil (°C)": (15.0, 40.0)},
    dissipates=True,
)
'''


@pytest.fixture
def thinning_oil(tmp_path: Path) -> Iterator[str]:
    file = tmp_path / "thinning_oil.py"
    file.write_text(OIL, encoding="utf-8")
    (name,) = offer_effects([file])
    yield name
    withdraw_effect(name)


def at(temperature: float) -> TapInput:
    return replace(TAP, columns=((COLUMN, temperature),))


def viscous(coefficient: float) -> Plant:
    law = {"viscous_friction": {"viscous_coefficient_n_s_per_m": coefficient}}
    return Plant(6e5, 465.0, 0.2, 0.15, effects=law)


def positions(plant: Plant, tap: TapInput) -> np.ndarray:
    return simulate_tap(plant, tap).sample(TIMES).position_m


@pytest.mark.slow
@given(
    st.lists(st.floats(-10, 10), min_size=ACROSS * (SPANS + 3), max_size=ACROSS * (SPANS + 3)),
    st.floats(-0.4, 1.4),
    st.floats(-0.4, 1.4),
)
def test_tensor_spline_is_scipys_inside_and_straight_beyond(
    coefficients: list[float], share_u: float, share_w: float
) -> None:
    table = np.array(coefficients).reshape(ACROSS, SPANS + 3)

    def weights(share: float, ends: tuple[float, float], spans: int) -> np.ndarray:
        knots = ends[0] + (ends[1] - ends[0]) / spans * np.arange(-3, spans + 4)
        u = ends[0] + share * (ends[1] - ends[0])
        inside = min(max(u, ends[0]), ends[1])
        spline = BSpline(knots, np.eye(spans + 3), 3)
        return spline(inside) + (u - inside) * spline.derivative()(inside)

    expected = weights(share_w, ENDS[1], 1) @ table @ weights(share_u, ENDS[0], SPANS)
    u, w = (low + share * (high - low) for share, (low, high) in zip((share_u, share_w), ENDS, strict=True))
    p = np.array([*ENDS[0], *ENDS[1], *coefficients])
    assert tensor_spline(u, w, p, SPANS) == pytest.approx(expected, abs=1e-9)
    basis = tensor_basis(np.array([[u, w]]), ENDS, SPANS)
    assert float((basis @ p[4:])[0]) == pytest.approx(expected, abs=1e-9)


def form_of(identifier: str) -> FreeForm:
    forms = {form.place: form for form in (*FREE_PAIR_FORMS.values(), *column_pair_forms(COLUMN))}
    return next(form for name, form in forms.items() if name.startswith(identifier))


def with_form(form: FreeForm, ends: tuple[tuple[float, float], tuple[float, float]], table: np.ndarray):
    coefficients = dict(zip(form.coefficients, table.ravel().tolist(), strict=True))
    knots = zip(("lower", "upper", "second_lower", "second_upper"), np.ravel(ends).tolist(), strict=True)
    values = {form.effect.identifier: {**dict(knots), **coefficients}}
    return Plant(6e5, 465.0, 0.2, 0.15, effects=values)


@pytest.mark.parametrize("temperature", [17.0, 33.0])
def test_a_term_over_a_column_is_another_plant_for_every_shot(temperature: float) -> None:
    form = form_of("free_drag_over_speed_and_column")
    plant = with_form(form, ENDS, np.outer(ACROSS_PLACES, np.ones(SPANS + 3)))
    np.testing.assert_allclose(
        positions(plant, at(temperature)), positions(viscous(temperature), TAP), atol=2e-12
    )
    np.testing.assert_allclose(positions(plant, TAP), positions(viscous(0.0), TAP), atol=1e-15)


def test_a_term_over_two_numbers_of_the_motion_is_the_named_law_it_has_become() -> None:
    ends = (ENDS[0], (-0.05, 0.05))
    form, flat = form_of("free_drag_over_speed_and_position"), np.ones(ACROSS)
    drag = {"quadratic_drag": {"drag_coefficient_n_s2_per_m2": 900.0}}
    expected = positions(Plant(6e5, 465.0, 0.2, 0.15, effects=drag), TAP)
    plant = with_form(form, ends, np.outer(flat, 900.0 * ALONG))
    np.testing.assert_allclose(positions(plant, TAP), expected, atol=2e-12)
    # Friction that rises with the place: mu_k (1 + g x) of the library, which moves mu_s as well.
    place = ends[1][0] + (ends[1][1] - ends[1][0]) * (np.arange(ACROSS) - 1.0)
    rising = with_form(
        form_of("free_friction_over_speed_and_position"),
        ends,
        np.outer(0.15 * 4.0 * place, np.ones(SPANS + 3)),
    )
    named = {"position_dependent_friction": {"gradient_per_m": 4.0}}
    expected = positions(Plant(6e5, 465.0, 0.2, 0.15, effects=named), TAP)
    assert np.abs(positions(rising, TAP) - expected).max() < 2e-7
    assert np.abs(positions(viscous(0.0), TAP) - expected).max() > 1e-6


def test_no_pair_is_offered_as_an_effect() -> None:
    assert not {form.effect.identifier for form in column_pair_forms(COLUMN)} & set(LIBRARY)
    assert column_pair_forms(COLUMN) is column_pair_forms(COLUMN)
    names = [form.effect.identifier for form in (*column_pair_forms(COLUMN), *column_pair_forms("oil"))]
    assert len(set(names)) == len(names)
    assert all(name.isidentifier() for name in names)


def test_a_law_of_a_column_keeps_the_contract_and_has_the_column_of_each_shot(thinning_oil: str) -> None:
    assert contract_faults(LIBRARY[thinning_oil]) == []
    taps = [at(15.0), at(27.5), TAP, at(40.0)]
    times = [TIMES] * len(taps)
    # Beside an effect on either side: what lies behind its parameters is the column's alone.
    around = ("adhesion", thinning_oil, "restoring_force")
    model = Ensemble(taps, around, position_time_s=times)
    values = {"adhesion": (0.0, 1e-4), thinning_oil: (100.0,), "restoring_force": (0.0,)}
    found = model.traces(np.array([6e5, 465.0, 0.2, 0.15, *(v for name in around for v in values[name])]))
    for position, coefficient in zip(
        found.position_m.reshape(len(taps), -1), (100.0, 50.0, 0.0, 0.0), strict=True
    ):
        np.testing.assert_allclose(position, positions(viscous(coefficient), TAP), atol=2e-12)


def test_a_cycle_that_does_not_say_its_column_is_judged_without_the_law(thinning_oil: str) -> None:
    plant = Plant(6e5, 465.0, 0.2, 0.15, effects={thinning_oil: {"k_n_s_per_m": 100.0}})
    assert not acts_on_speed(thinning_oil)
    assert linear_resistance(plant) == 0.0
    assert model_acceleration(plant, Capture(1, 0.1, 12.0, None, None)) is None


def test_a_law_that_moves_a_tap_although_its_column_is_not_known_is_told(tmp_path: Path) -> None:
    file = tmp_path / "stubborn_oil.py"
    shifted = OIL.replace("thinning_oil", "stubborn_oil").replace("-p[0] * v", "-(p[0] + 5.0) * v")
    file.write_text(shifted, encoding="utf-8")
    (name,) = offer_effects([file])
    try:
        assert any("is not known (nan)" in fault for fault in contract_faults(LIBRARY[name]))
    finally:
        withdraw_effect(name)
