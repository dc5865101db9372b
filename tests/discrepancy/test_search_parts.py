"""Parts of the search by themselves, against closed forms, exact refits and what they promise in words."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from impactcell.discrepancy.data import MIN_HELD_OUT, MIN_TRAINING, POSITION
from impactcell.discrepancy.model import effect_coordinates, fit_nominal
from impactcell.discrepancy.search import (
    acceptance,
    between_shots,
    candidate_scores,
    convergence,
    dominance,
    indistinguishability,
    model_error,
    residual_map,
    wild_bootstrap,
)
from impactcell.discrepancy.search.acceptance import accept_set
from impactcell.discrepancy.search.candidate_fits import finalists, is_at_bound, prefer_interior
from impactcell.discrepancy.search.conclusion import missing_shots
from impactcell.discrepancy.search.indistinguishability import CandidateFit
from impactcell.discrepancy.search.policy import POLICY
from tests.discrepancy.test_convergence import context_of


def test_the_error_that_shots_share_is_what_sizes_vary_by_beyond_chance() -> None:
    """Eight shapes a cell and channel, of three times the square that chance gives, 1.8 times and once."""
    count, information, chance = 8, 50.0, 0.01
    sizes = {(0, 0): 3.0, (0, 1): 1.8, (1, 1): 1.0}
    ratio = np.repeat([*sizes.values()], count)
    cell, channel = (np.repeat([key[place] for key in sizes], count) for place in (0, 1))
    each = np.full((4, len(ratio)), information * math.sqrt(chance / 4.0))
    evidence: Any = SimpleNamespace(
        map_scores=SimpleNamespace(
            information=np.full(len(ratio), information), each=each, amplitude=np.sqrt(ratio * chance)
        ),
        map=SimpleNamespace(
            cell=cell, channel=channel, products=SimpleNamespace(shared=np.zeros((1, len(ratio), 1)))
        ),
    )
    # a mean of 8 squares scatters by sqrt(2 / 8): up to twice the chance is none
    expected = np.where(ratio == 3.0, 2.0 * chance, 0.0)
    assert model_error.shared_error(evidence).variance == pytest.approx(expected)


def test_a_level_a_slope_and_a_bow_are_three_pieces() -> None:
    place = np.linspace(-1.0, 1.0, 600)
    residual = np.tile(5.0 + place + place**2, 40)
    bounds = 600 * np.arange(41)
    shots = SimpleNamespace(
        values=residual,
        channel=np.ones(residual.size, dtype=np.int64),
        samples_of=lambda shot: slice(int(bounds[shot]), int(bounds[shot + 1])),
    )
    problem: Any = SimpleNamespace(shots=shots, count=40)
    model: Any = SimpleNamespace(residual=residual)
    assert model_error.estimate_model_error(problem, model).pieces == pytest.approx(3.0)


@pytest.mark.parametrize(("promised", "expected"), [(3.9, True), (4.1, False)])
def test_what_a_step_promises_counts_in_units_of_what_the_model_leaves(
    monkeypatch: pytest.MonkeyPatch, promised: float, expected: bool
) -> None:
    """A model that leaves four times the noise's square has come to rest at four times the promise."""
    problem: Any = SimpleNamespace(shots=SimpleNamespace(values=np.zeros(100)))
    model: Any = SimpleNamespace(effects=("one",), misfit=lambda _: np.full(5, 80.0))
    monkeypatch.setattr(convergence, "promised_fall", lambda *_: promised * POLICY.max_promise)
    monkeypatch.setattr(convergence, "total_log_likelihood", lambda *_: 0.0)
    assert convergence.is_converged(problem, model) is expected


def test_no_shots_are_missing_where_there_are_just_enough() -> None:
    assert missing_shots(MIN_TRAINING, MIN_HELD_OUT) == 0
    assert missing_shots(MIN_TRAINING - 1, MIN_HELD_OUT) > 0
    assert missing_shots(MIN_TRAINING, MIN_HELD_OUT - 1) > 0


@pytest.mark.parametrize("off", [0.0, 3.0], ids=["at the optimum", "short of it"])
def test_likelihood_out_of_shot_is_that_of_an_exact_refit_of_quadratic_losses(
    monkeypatch: pytest.MonkeyPatch, off: float
) -> None:
    rng = np.random.default_rng(6)
    shots, p = 9, 3
    roots = rng.normal(size=(shots, p, 2 * p))
    H, best = roots @ roots.transpose(0, 2, 1), rng.normal(size=(shots, p))
    best -= np.linalg.solve(H.sum(0), np.einsum("iab,ib->a", H, best))  # so that all together are best at 0
    best += off
    group = [0, 0, 1, 2, 3, 4, 5, 6, 6]

    def losses(theta: np.ndarray) -> np.ndarray:
        return 0.5 * np.einsum("ia,iab,ib->i", theta - best, H, theta - best)

    linearisation = SimpleNamespace(
        information=H.sum(0), shot_information=H, shot_gradient=np.einsum("iab,ib->ia", H, best)
    )
    monkeypatch.setattr(indistinguishability, "linearise", lambda *_: linearisation)
    monkeypatch.setattr(indistinguishability, "MAX_FOLD_SHARE", 0.5)
    items = [SimpleNamespace(group=number) for number in group]
    problem: Any = SimpleNamespace(shots=SimpleNamespace(items=items), count=shots)
    problem.penalty_matrix, problem.bounds = np.zeros((p, p)), lambda: (np.full(p, -9.0), np.full(p, 9.0))
    problem.with_effects = lambda _: problem
    model: Any = SimpleNamespace(log_likelihood=lambda _: -losses(np.zeros(p)), effects=(), theta=np.zeros(p))
    each = indistinguishability.evaluate_out_of_shot(problem, model).each
    for shot in range(shots):
        others = np.array(group) != group[shot]
        theta = np.linalg.solve(H[others].sum(0), np.einsum("iab,ib->a", H[others], best[others]))
        assert each[shot] == pytest.approx(-losses(theta)[shot])


def test_a_rival_fitted_to_fewer_samples_is_held_to_what_it_would_leave_on_all(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def problem(size: int) -> Any:
        return SimpleNamespace(shots=SimpleNamespace(values=np.zeros(size)))

    def fitted(effect: str, size: int, excess: float) -> Any:
        return SimpleNamespace(effects=(effect,), residual=np.zeros(size), excess=excess)

    context: Any = SimpleNamespace(problem=problem(100), coarse=problem(25))
    monkeypatch.setattr(dominance, "estimate_model_error", lambda _, rival: rival)
    monkeypatch.setattr(dominance, "largest_rival_excess", lambda *_: 5.0)
    rivals = [fitted("a", 25, 1.2), fitted("b", 25, 1.3), fitted("c", 100, 4.9), fitted("d", 100, 5.1)]
    left: Any = None
    assert dominance._tied(context, fitted("best", 100, 4.0), left, rivals) == ("a", "c")


@pytest.mark.parametrize("scaled", [False, True])
def test_a_jump_of_a_single_sample_is_taken_out_of_small_steps_alone(scaled: bool) -> None:
    change = np.concatenate([np.full(5, 0.1), [40.0], np.full(5, 0.1)])
    fit: Any = SimpleNamespace(
        effects=(), theta=np.zeros(0), shot_parameters=None, residual=np.linspace(0.0, 1.0, 11)
    )
    model = SimpleNamespace(residual=lambda theta, _: fit.residual - change * theta[0])
    problem: Any = SimpleNamespace(with_effects=lambda _: model)
    point: Any = SimpleNamespace(theta=np.ones(1), amplitude=0, sign=1, scaled=scaled)
    direction = candidate_scores.effect_direction(problem, fit, "surface_tilt", point)
    assert direction == pytest.approx(np.where(change > 1.0, 0.0, change) if scaled else change)


def test_each_batch_has_a_factor_of_its_own() -> None:
    batches, changes = np.array([0, 0, 1, 2, 1, 2]), (0.07, -0.12)
    items = [
        SimpleNamespace(
            dwell_s=1.0, record=record, records=6, batch=batch, direction=1, covariates={"batch": batch}
        )
        for record, batch in enumerate(batches.tolist(), start=1)
    ]
    problem: Any = SimpleNamespace(shots=SimpleNamespace(items=items), batches=3)
    coordinates = candidate_scores.effect_coordinates("batch_shift", 3)
    theta = [coordinate.coordinate(value) for coordinate, value in zip(coordinates, changes, strict=True)]
    point: Any = SimpleNamespace(theta=np.array(theta))
    factors = candidate_scores.between_shot_factors(problem, "batch_shift", point)
    assert factors is not None
    assert np.exp(factors) == pytest.approx(1.0 + np.array([0.0, *changes])[batches])


def test_outcomes_with_a_tied_effect_exchanged_are_those_that_were_fitted() -> None:
    def fitted(*effects: str) -> Any:
        return SimpleNamespace(fit=SimpleNamespace(effects=effects))

    nominal: Any = SimpleNamespace(
        fit=SimpleNamespace(effects=()), candidate_scan=SimpleNamespace(p_value_of={"c": 0.02}.get)
    )
    selection = acceptance.SelectionResult(
        nominal, nominal, None, ("a", "b"), {"a": ("c", "never fitted")}, {"a": 0.01}, (fitted("b", "c"),)
    )
    (variant,) = acceptance.exchanged(selection)
    assert variant.added == ("c", "b")
    assert variant.accepted is selection.alternatives[0].fit
    assert variant.ties == {"c": ("a", "never fitted")}
    assert variant.p_values["c"] == 0.02


@pytest.mark.parametrize("count", [3, 10])
def test_shapes_of_a_phase_add_up_to_one_and_stand_for_their_middle(count: int) -> None:
    place, inside = np.linspace(0.0, 1.0, 91), np.arange(91) % 4 != 3
    hats = residual_map._hat_functions(place, inside, count)
    assert np.sum([hat for _, hat in hats], axis=0) == pytest.approx(inside.astype(float))
    middles = np.array([middle for middle, _ in hats])
    assert np.sum([middle * hat for middle, hat in hats], axis=0) == pytest.approx(place * inside)
    assert middles == pytest.approx(np.linspace(0.0, 1.0, count))


def test_mirrored_shots_tell_a_common_score_from_one_of_either_sign() -> None:
    """A score that all of thirty shots share is rare under mirroring; of one that is noise p is uniform."""
    rng, shots, noise = np.random.default_rng(8), 30, 40
    scores: Any = SimpleNamespace(
        each=np.column_stack([rng.normal(1.5, 1.0, shots), rng.normal(size=(shots, noise))]),
        leverage=np.zeros((shots, noise + 1, 1)),
    )
    linearisation: Any = SimpleNamespace(information=np.eye(1), shot_gradient=np.zeros((shots, 1)))
    tests = wild_bootstrap.wild_bootstrap(linearisation, scores, np.arange(noise + 1), (1,))
    expected = scores.each.sum(0) ** 2 / (scores.each**2).sum(0)
    assert tests.statistic == pytest.approx(expected)
    assert tests.p_adjusted[0] < 0.02
    assert 0.35 < tests.p_single[1:].mean() < 0.65
    assert tests.p_single[1:].min() < 0.2


@pytest.mark.parametrize(("spread", "tied"), [(0.012, ("surface_tilt",)), (0.06, ())])
def test_a_rival_that_leaves_the_factors_wider_is_told_apart_though_a_few_shots_make_the_difference(
    spread: float, tied: tuple[str, ...]
) -> None:
    """Friction by direction was tied with a stiffness that left the factors six times as wide."""

    def candidate(effect: str, spread: float, each: list[float]) -> Any:
        fit = SimpleNamespace(
            effects=(effect,),
            coordinates=(),
            theta=np.empty(0),
            spread=spread,
            misfit=lambda _: np.full(20, 50.0),
        )
        return CandidateFit(fit, np.array(each))

    sets = [candidate("direction_asymmetry", 0.01, [0.0] * 20)]
    sets.append(candidate("surface_tilt", spread, [-6.0] * 3 + [0.0] * 17))
    nominal: Any = SimpleNamespace(
        fit=SimpleNamespace(effects=()), candidate_scan=SimpleNamespace(p_value_of=lambda _: 0.001)
    )
    shots = SimpleNamespace(visited_m=(-0.01, 0.01))
    problem: Any = SimpleNamespace(count=20, shots=shots, sizes=np.full(20, 50))
    found = accept_set(problem, (nominal, nominal), sets, [], [], ())
    assert found.ties == {"direction_asymmetry": tied}


SLID: Any = SimpleNamespace(visited_m=(-0.008, 0.006))


def shaped(effect: str, residual: float = 0.0, **values: float) -> Any:
    """Fit of one effect with these parameters, the others typical."""
    coordinates = effect_coordinates(effect, 1)
    theta = [c.coordinate(values.get(c.parameter, c.value(c.initial))) for c in coordinates]
    return SimpleNamespace(
        effects=(effect,), coordinates=coordinates, theta=np.array(theta), residual=np.full(100, residual)
    )


@pytest.mark.parametrize(
    ("effect", "values", "is_name"),
    [
        ("friction_patch", {"position_m": 0.002, "width_m": 0.001}, True),
        ("friction_patch", {"position_m": 0.0061, "width_m": 0.001}, False),
        ("friction_patch", {"position_m": -0.0081, "width_m": 0.001}, False),
        ("friction_patch", {"position_m": 0.002, "width_m": 0.015}, False),
        ("friction_patch", {"position_m": 0.002, "width_m": 5e-5}, False),  # the end of its range
        ("periodic_friction", {"period_m": 0.027}, True),
        ("periodic_friction", {"period_m": 0.029}, False),
        ("viscous_friction", {}, True),
    ],
)
def test_a_shape_where_no_shot_has_been_is_no_name(
    effect: str, values: dict[str, float], *, is_name: bool
) -> None:
    """A patch far beyond the end of all slides was named for friction that grows along the table."""
    assert is_at_bound(SLID, shaped(effect, **values)) is not is_name


def test_without_a_position_no_shape_is_where_no_shot_has_been() -> None:
    nowhere: Any = SimpleNamespace(visited_m=(0.0, 0.0))
    assert not is_at_bound(nowhere, shaped("friction_patch", position_m=0.03))


@pytest.mark.parametrize(("left", "first"), [(1.2, "position_dependent_friction"), (1.5, "friction_patch")])
def test_a_name_inside_its_range_goes_before_a_shape_at_its_end_that_leaves_little_less(
    left: float, first: str
) -> None:
    """Of a squared gap of 15 it may leave 0.75 more."""
    nominal, beyond = shaped("viscous_friction", 4.0), shaped("friction_patch", 1.0, position_m=0.02)
    nominal.effects = ()
    inside = shaped("position_dependent_friction", left)
    ranking = [CandidateFit(beyond, np.zeros(20)), CandidateFit(inside, np.full(20, -40.0))]
    problem: Any = SimpleNamespace(shots=SLID, sizes=np.full(20, 50))
    beyond.misfit = lambda _: np.full(20, 50.0)
    assert prefer_interior(problem, nominal, ranking)[0].fit.effects == (first,)


def test_of_the_likeliest_as_many_inside_their_range_are_finalists_as_others() -> None:
    def likely(fit: Any, each: float) -> Any:
        fit.log_likelihood = lambda _: np.full(20, each)
        fit.misfit = lambda _: np.full(20, 50.0)
        return fit

    rough = [
        likely(shaped("friction_patch", position_m=0.02), 0.0),
        likely(shaped("periodic_friction", period_m=0.05), -50.0),
        likely(shaped("position_dependent_friction"), -100.0),
        likely(shaped("viscous_friction"), -200.0),
        likely(shaped("restoring_force"), -300.0),
    ]
    coarse = SimpleNamespace(shots=SLID, sizes=np.full(20, 50))
    context: Any = SimpleNamespace(coarse=coarse)
    assert finalists(context, rough) == rough[:4]


def test_effects_that_the_factors_speak_for_are_fitted_with_those_within_shots_that_no_fit_has_yet(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of the former only those, of the latter all, from where a start was found; and none by themselves."""
    p_values = {
        "friction_drift": 0.001,
        "hertz_contact": 0.9,
        "batch_shift": 0.9,
        "surface_tilt": 0.001,
        "stiction_ageing": 0.001,
    }
    starts = {"friction_drift": (np.zeros(1),), "surface_tilt": (np.zeros(1),), "batch_shift": (np.zeros(1),)}
    starts["hertz_contact"] = (np.ones(1),)
    fit = SimpleNamespace(effects=("viscous_friction",))
    scan = SimpleNamespace(
        gains=lambda: dict.fromkeys(p_values, 1.0),
        p_value_of=p_values.get,
        fit=fit,
        candidates=None,
        scores=None,
    )
    monkeypatch.setattr(
        candidate_scores,
        "starting_points",
        lambda _candidates, _scores, effect, _most: starts.get(effect, ()),
    )
    monkeypatch.setattr(between_shots, "run_tasks", lambda _, tasks: tasks)
    context: Any = SimpleNamespace(problem=SimpleNamespace(with_effects=lambda effects: effects))
    evidence: Any = SimpleNamespace(candidate_scan=scan)
    tasks = between_shots._fits(context, evidence, {"hertz_contact"})
    assert [task.problem for task in tasks] == [
        ("viscous_friction", "friction_drift"),
        ("viscous_friction", "surface_tilt"),
    ]
    assert [task.starts for task in tasks] == [starts["friction_drift"], starts["surface_tilt"]]
    assert len(between_shots._fits(context, evidence, ())) == 3
    p_values["friction_drift"] = p_values["stiction_ageing"] = 0.9
    assert between_shots._fits(context, evidence, ()) == []


def test_what_is_alike_whichever_way_a_part_is_tapped_goes_with_no_direction() -> None:
    """Places count along the tap: friction that grows with the speed holds back parts both ways."""
    context = context_of("viscous_friction")
    directions = {shot.direction for shot in context.problem.shots.items}
    assert directions == {-1, 1}
    evidence = context.test_model(fit_nominal(context.problem))
    of_position = evidence.map.channel == POSITION
    column = evidence.map.cell % len(evidence.map.columns)
    mean, direction = (
        float(evidence.map_scores.gain[of_position & (column == evidence.map.columns.index(name))].max())
        for name in (residual_map.ALL, "direction")
    )
    assert mean > 20.0 * direction
