"""A trial that came to rest short of its optimum neither wins nor loses."""

from dataclasses import replace

import numpy as np
import pytest

from impactcell.discrepancy.data.noise_floor import sensor_noise
from impactcell.discrepancy.data.prepared_campaign import prepare, shot_set
from impactcell.discrepancy.model.initial_guess import fit_nominal
from impactcell.discrepancy.model.least_squares import Fit, fit, promised_fall
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.nominal_model import NominalModel, NominalModels
from impactcell.discrepancy.open_records import Basis, with_known
from impactcell.discrepancy.search import indistinguishability, model_selection
from impactcell.discrepancy.search.acceptance import reject
from impactcell.discrepancy.search.context import SearchContext
from impactcell.discrepancy.search.convergence import converge, is_converged
from impactcell.discrepancy.search.indistinguishability import (
    evaluate_out_of_shot,
    rank_out_of_shot,
    total_log_likelihood,
)
from impactcell.discrepancy.search.model_selection import select_model
from impactcell.discrepancy.search.one_more import SearchState
from impactcell.physics.effects import LIBRARY
from tests.discrepancy.test_workflow import make

pytestmark = pytest.mark.slow

TILTED = ("surface_tilt", "hunt_crossley_damping")


def context_of(*hidden: str) -> SearchContext:
    prepared = prepare(make(*hidden, shots=20))
    shots = shot_set(prepared, np.arange(20), sensor_noise(prepared).noise_std)
    problem = Problem(shots, len(prepared.batches))
    serial = lambda function, items: [function(item) for item in items]  # noqa: E731
    return SearchContext(problem, problem, prepared, tuple(LIBRARY), 1, serial, floor_is_certain=True)


@pytest.fixture(scope="module")
def context() -> SearchContext:
    return context_of(*TILTED)


def fitted(problem: Problem, base: Fit, *effects: str) -> Fit:
    model = problem.with_effects((*base.effects, *effects))
    start = np.array([coordinate.initial for coordinate in model.coordinates[len(base.theta) :]])
    return fit(model, np.concatenate([base.theta, start]), base.shot_parameters, spread=base.spread)


def moved(problem: Problem, model: Fit, coordinate: str, by: float) -> Fit:
    """The same model away from its optimum, as a fit that came to rest there."""
    theta = model.theta.copy()
    theta[[one.parameter for one in model.coordinates].index(coordinate)] += by
    residual = problem.with_effects(model.effects).residual(theta, model.shot_parameters)
    return replace(model, theta=theta, residual=residual)


def test_a_fit_at_its_optimum_promises_nothing_and_one_beside_it_much(context: SearchContext) -> None:
    nominal = fit_nominal(context.problem)
    tilted = fitted(context.problem, nominal, "surface_tilt")
    assert promised_fall(context.problem, tilted) < 1.0
    assert is_converged(context.problem, tilted, [nominal])
    beside = moved(context.problem, tilted, "mu_k", 0.02)
    assert promised_fall(context.problem, beside) > 100.0
    assert not is_converged(context.problem, beside, [nominal])


def test_a_trial_worse_than_a_model_inside_it_starts_again_from_there() -> None:
    # Both fits of these come to their optimum on every machine; contact damping rests where rounding has it.
    context = context_of("surface_tilt", "quadratic_drag")
    problem = context.problem
    nominal = fit_nominal(problem)
    dragged = fitted(problem, nominal, "quadratic_drag")
    both = fitted(problem, dragged, "surface_tilt")
    assert promised_fall(problem, both) < 1e-3
    stuck = moved(problem, both, "drag_coefficient_n_s2_per_m2", 0.5)
    inner = [nominal, dragged]
    assert total_log_likelihood(problem, stuck) < total_log_likelihood(problem, dragged) - 200.0
    (mended,), others = converge(context, [stuck], inner)
    assert others == []
    assert set(mended.effects) == {"surface_tilt", "quadratic_drag"}
    assert total_log_likelihood(problem, mended) > total_log_likelihood(problem, dragged)
    assert total_log_likelihood(problem, mended) == pytest.approx(
        total_log_likelihood(problem, both), abs=0.01
    )


def test_what_does_not_converge_is_left_out_and_told(
    context: SearchContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(problem: Problem, model: Fit) -> float:
        return 1e6 if "hunt_crossley_damping" in model.effects else 0.0

    monkeypatch.setattr("impactcell.discrepancy.search.convergence.promised_fall", never)
    library = ("surface_tilt", "hunt_crossley_damping", "direction_asymmetry")
    selection = select_model(replace(context, library=library), fit_nominal(context.problem))
    tried = {effect for one in selection.alternatives for effect in one.effects}
    assert "hunt_crossley_damping" not in {*tried, *selection.added}
    assert any("hunt_crossley_damping" in effects for effects in selection.unconverged)


@pytest.mark.parametrize("is_known", [True, False])
def test_what_an_earlier_search_found_is_a_start_where_none_leads_from_the_nominal_model(
    monkeypatch: pytest.MonkeyPatch,
    *,
    is_known: bool,
) -> None:
    """Strong Stribeck friction beside open velocities and masses was `unknown`, and its own form the law."""
    context = context_of("surface_tilt")
    nominal = fit_nominal(context.problem)
    known = (fitted(context.problem, nominal, "surface_tilt"),) if is_known else ()
    monkeypatch.setattr("impactcell.discrepancy.search.one_more.screen", lambda *_: [])
    context = replace(context, library=("surface_tilt", "viscous_friction"), known=known)
    selection = select_model(context, nominal)
    assert selection.added == (("surface_tilt",) if is_known else ())


@pytest.mark.parametrize("is_at_floor", [True, False])
def test_factors_are_asked_first_only_where_no_effect_brings_the_traces_to_the_noise(
    monkeypatch: pytest.MonkeyPatch,
    *,
    is_at_floor: bool,
) -> None:
    """Strong tilt beside contact damping was asymmetry alone, and the traces stayed 2.7 floors off."""
    context = context_of("hunt_crossley_damping")
    nominal = fit_nominal(context.problem)
    single = fitted(context.problem, nominal, "hunt_crossley_damping" if is_at_floor else "surface_tilt")
    assert context.reaches_floor(single) == is_at_floor
    evidence = context.test_model(nominal)
    asked = []
    monkeypatch.setattr(model_selection, "accept_between_shots", lambda *_: asked.append(1))
    monkeypatch.setattr(model_selection, "accept_dominant", lambda *_: None)
    fits = rank_out_of_shot(context.problem, [single])
    state = SearchState({0: evidence}, {1: [single]}, {1: fits}, result=reject(evidence, evidence, ()))
    model_selection._dominant_or_none(context, state)
    assert bool(asked) != is_at_floor


def test_models_of_a_search_go_on_beside_settings_that_are_opened() -> None:
    context = context_of("surface_tilt")
    training = np.arange(context.problem.count)
    floor = sensor_noise(context.prepared)
    nominal = NominalModel(context.prepared, floor, training, context.problem, fit_nominal(context.problem))
    context = replace(context, library=("surface_tilt",))
    basis = Basis(NominalModels(nominal), nominal, context, select_model(context, nominal.fit))
    opened = nominal.with_settings(("log_velocity",))
    (known,) = with_known(context, basis, opened).known
    assert known.effects == ("surface_tilt",)
    assert promised_fall(opened.problem, known) < 1.0
    assert known.shot_parameters.log_velocity.any()


def test_a_shot_that_alone_tells_a_parameter_makes_no_difference_without_end(
    context: SearchContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = context.problem
    nominal = fit_nominal(problem)
    exact = indistinguishability.linearise(problem, nominal)
    n, p = exact.shot_gradient.shape
    information = np.zeros((n, p + 1, p + 1))
    information[:, :p, :p] = exact.shot_information
    information[:, p, p] = 1e-9
    information[0, p, p] = 1e6
    gradient = np.hstack([exact.shot_gradient, np.zeros((n, 1))])
    gradient[0, p] = 30.0
    seen = replace(
        exact, shot_information=information, information=information.sum(0), shot_gradient=gradient
    )
    monkeypatch.setattr(
        indistinguishability,
        "unmet_gradient",
        lambda _, __, linearised: np.zeros(linearised.shot_gradient.shape[1]),
    )
    without = evaluate_out_of_shot(problem, nominal).each
    monkeypatch.setattr(indistinguishability, "linearise", lambda problem, model: seen)
    lost = without - evaluate_out_of_shot(problem, nominal).each
    assert np.isfinite(lost).all()
    assert 0.0 < lost[0] < 100.0
    assert lost[1:] == pytest.approx(0.0, abs=1e-6)
