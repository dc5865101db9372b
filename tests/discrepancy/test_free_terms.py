"""Held parameters, penalties, and free-form terms fitted to plants with a law that no library has."""

from dataclasses import replace

import numpy as np
import pytest

from impactcell.discrepancy.data import prepare, sensor_noise, shot_set, split_held_out
from impactcell.discrepancy.laws.covariates import visited
from impactcell.discrepancy.laws.finding import settled
from impactcell.discrepancy.laws.free_term import FreeTerm, fit_free_terms
from impactcell.discrepancy.laws.term_start import TermStart
from impactcell.discrepancy.model import (
    Constraints,
    Fit,
    Problem,
    Roughness,
    fit,
    fit_nominal,
    refit_shot_parameters,
)
from impactcell.discrepancy.model.reach import shots_reached
from impactcell.physics.bspline import spline_basis
from impactcell.physics.free_forms import FINER
from tests.discrepancy.study import Job, campaign

pytestmark = pytest.mark.slow


def _fitted(hidden: str, strength: float = 1.0, shots: int = 24) -> tuple[Problem, Fit, Problem]:
    prepared = prepare(campaign(Job("free", (hidden,), 8101, strength=strength, shots=shots)))
    floor = sensor_noise(prepared)
    training, held_out = split_held_out(prepared, 3)
    problem, held = (
        Problem(shot_set(prepared, part, floor.noise_std), len(prepared.batches))
        for part in (training, held_out)
    )
    return problem, fit_nominal(problem, None), held


def _held_rms(term: FreeTerm, held: Problem) -> float:
    model = held.constrained(term.fit.effects, term.problem.constraints)
    return float(np.sqrt(np.mean(refit_shot_parameters(model, term.fit).residual ** 2)))


def test_a_held_parameter_stays_and_is_no_coordinate() -> None:
    problem, nominal, _ = _fitted("viscous_friction", shots=8)
    name = "viscous_friction.viscous_coefficient_n_s_per_m"
    held = problem.constrained(("viscous_friction",), Constraints({name: 33.0}))
    assert len(held.coordinates) == len(nominal.coordinates)
    parameters = held.plant_parameters(nominal.theta)
    assert parameters[held.forward.names(("viscous_friction",)).index(name)] == 33.0
    assert held.select(np.array([0, 1])).constraints is held.constraints


@pytest.mark.parametrize("place", ["free_friction_over_position", "free_force_over_position"])
def test_coefficients_that_a_shot_does_not_come_to_have_no_derivative_there(place: str) -> None:
    problem, nominal, _ = _fitted("position_dependent_friction", shots=10)
    form = FINER[place]
    span = visited(problem, nominal, form)
    assert span is not None
    start = TermStart.at(problem, nominal, form, span)
    coefficients = np.random.default_rng(1).normal(0.0, 0.3, len(form.coefficients))
    theta = np.append(nominal.theta, coefficients)
    state = start.problem.evaluate(theta, nominal.shot_parameters, nominal.spread)
    constraints = start.problem.constraints
    reached = shots_reached(problem.shots, constraints, start.problem.coordinates, state.residual)
    assert reached is not None
    assert 0.1 < reached.mean() < 0.6
    everywhere = start.problem.constrained(start.problem.effects, replace(constraints, supports=()))
    jacobian = start.problem.shared_jacobian(state)
    assert np.array_equal(jacobian, everywhere.shared_jacobian(state))
    # One coordinate alone, as a fit asks for at a bound.
    last = len(theta) - 1
    assert np.array_equal(start.problem.shared_derivative(state, last), jacobian[last])


def test_a_penalty_draws_towards_zero_as_its_normal_equations_say() -> None:
    problem, nominal, _ = _fitted("viscous_friction", shots=8)
    effects = ("viscous_friction",)
    start = np.append(nominal.theta, 0.0)
    free = fit(problem.with_effects(effects), start, nominal.shot_parameters, spread=nominal.spread)
    strong = Roughness("viscous_friction", ("viscous_coefficient_n_s_per_m",), np.array([[1e6]]))
    held = problem.constrained(effects, Constraints(roughness=(strong,)))
    penalised = fit(held, start, nominal.shot_parameters, spread=nominal.spread)
    assert abs(free.theta[-1]) > 0.1
    assert abs(penalised.theta[-1]) < 1e-3 * abs(free.theta[-1])
    assert held.penalty(penalised.theta) == pytest.approx(1e12 * penalised.theta[-1] ** 2)


@pytest.mark.long
def test_quadratic_drag_is_found_as_a_straight_line_over_speed() -> None:
    problem, nominal, held = _fitted("quadratic_drag")
    best = fit_free_terms(problem, nominal, 1)[0]
    assert best.form.effect.identifier == "free_drag_over_speed"
    assert _held_rms(best, held) < 1.05
    u = np.linspace(0.3, 1.0, 8) * best.visited.upper
    drag = spline_basis(u, best.visited.lower, best.visited.upper, best.form.spans) @ best.coefficients
    np.testing.assert_allclose(drag, 250.0 * u, rtol=0.05)
    # Where its fit was ended early does not matter for what is proposed.
    start = np.append(nominal.theta, np.zeros(best.fit.theta.size - nominal.theta.size))
    model = best.problem
    short = fit(model, start, nominal.shot_parameters, spread=nominal.spread, most_steps=1)
    early = replace(best, fit=short)
    assert not np.allclose(early.coefficients, best.coefficients, rtol=0.005, atol=0.5)
    np.testing.assert_allclose(settled(early).coefficients, settled(best).coefficients, rtol=0.002, atol=0.2)


def test_a_contact_that_bends_is_found_over_indentation() -> None:
    problem, nominal, held = _fitted("bilinear_contact")
    before = float(np.sqrt(np.mean(refit_shot_parameters(held, nominal).residual ** 2)))
    best = fit_free_terms(problem, nominal, 1)[0]
    assert best.form.effect.identifier == "free_stiffness_over_indentation"
    assert _held_rms(best, held) < 0.1 * before
