"""Named effects held against free forms: what a smooth force of no name leaves is not named after it."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from impactcell.discrepancy.data import decimate
from impactcell.discrepancy.laws.free_rivals import beside_terms, with_more_pieces
from impactcell.discrepancy.laws.scored_model import ScoredModel
from impactcell.discrepancy.laws.standing import (
    SAMPLES,
    FreeForms,
    fit_free_forms,
    is_in_its_place,
    outdoes,
    outdone_by,
    stands_beside,
)
from impactcell.discrepancy.model import Problem, refit_shot_parameters
from impactcell.discrepancy.report.result import result_document
from impactcell.discrepancy.search import Outdone
from impactcell.discrepancy.workflow import DiscrepancyResult, investigate
from impactcell.physics.effects import LIBRARY as EFFECTS
from impactcell.physics.free_forms import FINER
from impactcell.physics.remainder_forms import FILTERS, FORCE_FILTER, POSITION_FILTER, REMAINDER_FORMS
from tests.discrepancy.study import Job, campaign, strengths

SHOTS = 16
LIBRARY = ("hertz_contact", "friction_patch", "periodic_friction", "force_sensor_gain")
"""What may be named: the effect that is hidden, and what is drawn to a remainder."""


def _investigated(hidden: tuple[str, ...], multiples: tuple[float, ...], seed: int) -> DiscrepancyResult:
    job = Job("model_error", hidden, seed, target=2.0, shots=SHOTS)
    with patch("impactcell.discrepancy.workflow.find_law", lambda *_: None):
        return investigate(campaign(job, multiples), seed=seed, library=LIBRARY)


@pytest.mark.long
def test_an_effect_is_named_and_measured_beside_a_force_of_which_nobody_knows_the_form() -> None:
    strength = 1.0
    found = _investigated(("force_sensor_gain", "wandering_force"), (strength, 0.15), 600_001)
    assert found.added == ("force_sensor_gain",)
    assert found.verdict == "named"
    assert not found.conclusion.remaining.explained
    assert found.validation.gap_after < found.validation.gap_before
    truth = strengths("force_sensor_gain", strength, 600_001)["relative_error"]
    (alone,) = (one for one in found.parameters if one.effect)
    (beside,) = (one for one in found.stated_parameters if one.effect)
    told = result_document(found)["effects"][0]["parameters"]["relative_error"]
    assert told["value"] == pytest.approx(beside.value, rel=1e-5)
    assert beside.low < truth < beside.high
    assert beside.high - beside.low < 0.5 * (alone.high - alone.low)  # what remains pulls less


@pytest.mark.long
@pytest.mark.parametrize("seed", [600_000])
def test_a_force_of_which_nobody_knows_the_form_is_named_after_nothing(seed: int) -> None:
    found = _investigated(("wandering_force",), (0.2,), seed)
    assert found.verdict == "unknown"
    assert found.added == ()


@pytest.mark.slow
def test_a_term_that_leaves_something_is_given_more_pieces_alone_and_beside_the_effect() -> None:
    """A model error with many waves hid an adhesion: beside a curve of few pieces it left 1.13 floors."""
    place, seed, held = "free_force_over_position", 720_023, []
    job = Job("model_error", ("adhesion", "wandering_force"), seed, target=2.0, shots=SHOTS)
    with (
        patch("impactcell.discrepancy.workflow.find_law", lambda *_: None),
        patch(
            "impactcell.discrepancy.workflow.hold_against_free_forms",
            lambda *given: held.append(given) or given[1],
        ),
    ):
        investigate(campaign(job, (0.3097, 0.0526)), seed=seed, library=("adhesion",))
    ((context, selection),) = held
    problem = context.problem
    fewer = replace(context, coarse=Problem(decimate(problem.shots, SAMPLES), problem.batches))
    with (
        patch("impactcell.discrepancy.laws.standing.REMAINDER_FORMS", {place: REMAINDER_FORMS[place]}),
        patch("impactcell.discrepancy.laws.standing._fit_filter", lambda *_: None),
        patch("impactcell.discrepancy.laws.free_rivals.REMAINDER_FORMS", {place: REMAINDER_FORMS[place]}),
    ):
        forms = fit_free_forms(fewer, refit_shot_parameters(fewer.coarse, selection.nominal.fit))
        (beside,) = beside_terms(fewer, forms)
        finer, (beside_finer,) = with_more_pieces(fewer, forms, [beside], place)
    (alone,), (alone_finer,) = forms.alone, finer.alone
    assert finer.terms[place].form is FINER[place]
    assert alone_finer.place == beside_finer.place == place
    assert alone_finer.mean_square < 0.97 * alone.mean_square
    assert beside_finer.mean_square < 0.97 * beside.mean_square
    assert (beside_finer.effect, beside_finer.p_value) == ("adhesion", beside.p_value)
    assert beside_finer.is_told_from(alone_finer)


def _leaving(mean_square: float) -> Any:
    return SimpleNamespace(residual=np.full(4000, mean_square**0.5))


def _scored(effect: str, place: str, mean_square: float, ahead: float = 0.0) -> ScoredModel:
    """Model that leaves so much, and that each of twenty shots finds so much likelier, more or less."""
    each = ahead * (1.0 + 0.2 * np.cos(np.arange(20)))
    return ScoredModel(effect, place, _leaving(mean_square), each, 1.0, 5.0)


@pytest.mark.parametrize(
    ("place", "left", "ahead", "falls"),
    [
        ("free_force_over_position", 1.0, 50.0, True),
        ("free_force_over_position", 3.1, 0.0, True),
        ("free_force_over_position", 3.2, -1.0, False),
        ("free_friction_over_position", 1.0, 50.0, True),
        ("free_friction_over_position", 1.0, 1.0, False),
        ("free_friction_over_position", 2.0, 50.0, False),
        ("free_friction_over_position", 0.5, -50.0, True),
    ],
)
def test_a_name_that_leaves_something_falls_to_free_forms(
    place: str, left: float, ahead: float, *, falls: bool
) -> None:
    named = _scored("friction_patch", "", 2.5)
    assert outdoes(_scored("", place, left, ahead), named, _leaving(20.0)) is falls


@pytest.mark.parametrize(
    ("place", "ahead", "falls"),
    [
        ("free_friction_over_position", 50.0, False),
        ("free_force_over_position", 1.0, False),
        ("free_force_over_position", 50.0, True),
    ],
)
def test_a_name_that_leaves_nothing_falls_only_to_what_shots_tell_from_it_elsewhere(
    place: str, ahead: float, *, falls: bool
) -> None:
    named = _scored("friction_patch", "", 1.1)
    assert outdoes(_scored("", place, 1.0, ahead), named, _leaving(20.0)) is falls


def _seconds(*models: ScoredModel) -> Any:
    """Make second forms, beside a name or beside a form, come out as given."""
    of = {"": [model for model in models if not model.effect], "named": [m for m in models if m.effect]}
    return patch(
        "impactcell.discrepancy.laws.standing.with_second",
        lambda _context, _problem, _base, effect: of["named" if effect else ""],
    )


@pytest.mark.parametrize(
    ("left", "second", "ahead", "stays"),
    [
        (5.0, "free_friction_over_speed", 50.0, False),
        (5.0, "free_friction_over_speed", 40.0, False),
        (5.0, "free_friction_over_speed", 39.0, True),
        (5.0, "free_reading_over_force", 50.0, True),
        (2.0, "free_friction_over_speed", 39.0, True),
        (1.9, "free_friction_over_speed", 39.0, False),
        (1.0, "free_friction_over_speed", 39.0, False),
    ],
)
def test_a_name_that_shows_beside_a_form_falls_to_a_second_form_elsewhere_or_if_the_form_needs_it_little(
    left: float, second: str, ahead: float, *, stays: bool
) -> None:
    """A gain of the force sensor was named beside friction over position, for friction that came late."""
    place = "free_friction_over_position"
    named = _scored("force_sensor_gain", place, 1.01, 40.0)
    term: Any = SimpleNamespace(problem=None, fit=None)
    forms = FreeForms(_leaving(20.0), (_scored("", place, left),), {place: term})
    with _seconds(_scored("", second, 1.0, ahead)):
        assert stands_beside(SimpleNamespace(), named, forms) is stays  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("alone", "beside_name", "beside_form", "outdone"),
    [
        (50.0, 60.0, 100.0, True),
        (50.0, 100.0, 60.0, False),
        (50.0, 99.9, 100.0, False),
        (1.0, 60.0, 100.0, False),
    ],
)
def test_in_its_place_a_form_outdoes_a_name_only_where_it_keeps_ahead_with_a_second_beside_each(
    alone: float, beside_name: float, beside_form: float, *, outdone: bool
) -> None:
    """A patch was named for friction that came late: a curve over position follows it better."""
    named = _scored("friction_patch", "", 2.5)
    own, elsewhere = "free_friction_over_position", "free_friction_over_speed"
    form = _scored("", own, 1.6, alone)
    fit: Any = SimpleNamespace(effects=("friction_patch",), residual=np.ones(10))
    context: Any = SimpleNamespace(coarse=SimpleNamespace(with_effects=lambda _effects: None))
    term: Any = SimpleNamespace(problem=None, fit=None)
    given: Any = SimpleNamespace(accepted=fit, nominal=None)
    seconds = (
        _scored("friction_patch", elsewhere, 1.4, beside_name), _scored("", elsewhere, 1.2, beside_form)
    )  # fmt: skip
    named = replace(named, fit=SimpleNamespace(residual=named.fit.residual, effects=fit.effects))  # type: ignore[arg-type]
    with (
        _seconds(*seconds),
        patch("impactcell.discrepancy.laws.standing.refine", lambda *_: [fit]),
        patch("impactcell.discrepancy.laws.standing.score_fit", lambda *_: named),
    ):
        found = outdone_by(context, given, FreeForms(_leaving(20.0), (form,), {own: term}))
    assert found == (Outdone("friction_patch", own, same_place=True) if outdone else None)


@pytest.mark.parametrize(
    ("spread", "numbers", "chance", "falls"),
    [
        (0.010, 5.0, 0.3, True),
        (0.010, 5.0, 1e-4, False),
        (0.009, 10.0, 0.3, False),
        (0.004, 15.0, 0.3, True),
        (0.004, 15.0, None, True),
        (0.0, 25.0, 0.3, False),
    ],
)
def test_a_name_between_shots_falls_to_a_form_that_narrows_the_factors_as_much_for_its_numbers(
    spread: float, numbers: float, chance: float | None, *, falls: bool
) -> None:
    own: Any = SimpleNamespace(log_factor=np.zeros(20))
    fit: Any = SimpleNamespace(spread=spread, residual=np.ones(10), shot_parameters=own)
    named: Any = SimpleNamespace(
        spread=0.010,
        residual=np.ones(10),
        effects=("direction_asymmetry",),
        coordinates=(None,) * 5,
        log_likelihood=lambda _shots: np.zeros(20),
    )
    form = ScoredModel("", "free_force_over_position", fit, np.zeros(20), 1.0, numbers)
    context: Any = SimpleNamespace(coarse=SimpleNamespace(count=20, shots=None))
    selection: Any = SimpleNamespace(accepted=named, nominal=None)
    with (
        patch("impactcell.discrepancy.laws.standing.refine", lambda *_: [named]),
        patch("impactcell.discrepancy.laws.standing.chance_of_order", lambda *_: chance),
    ):
        outdone = outdone_by(context, selection, FreeForms(named, (form,), {}))
    assert (outdone is not None) is falls


@pytest.mark.parametrize(
    ("effect", "place"),
    [
        ("channel_skew", FORCE_FILTER.identifier),
        ("force_sensor_lag", FORCE_FILTER.identifier),
        ("channel_skew", POSITION_FILTER.identifier),
        ("position_sensor_lag", POSITION_FILTER.identifier),
        ("friction_patch", "free_friction_over_position"),
        ("viscous_friction", "free_drag_over_speed"),
        ("hertz_contact", "free_stiffness_over_indentation"),
        ("adhesion", "free_pull_over_gap"),
        ("restoring_force", "free_force_over_position"),
        ("hunt_crossley_damping", "free_damping_over_indentation"),
        ("surface_tilt", "free_force_over_position"),
    ],
)
def test_an_effect_has_its_place_among_the_free_forms(effect: str, place: str) -> None:
    assert place in {*REMAINDER_FORMS, *FILTERS}
    assert effect in EFFECTS
    assert is_in_its_place(effect, place)
    assert not is_in_its_place(effect, "free_speed_over_time")


@pytest.mark.parametrize(
    ("effect", "place"),
    [
        ("restoring_force", "free_drag_over_speed"),
        ("quadratic_drag", "free_force_over_position"),
        ("hunt_crossley_damping", "free_stiffness_over_indentation"),
        ("mass_error", "free_reading_over_force"),
    ],
)
def test_a_form_that_does_not_read_what_an_effect_reads_is_not_in_its_place(effect: str, place: str) -> None:
    """They may enter the equations of motion at the same point all the same: a spring is no drag."""
    assert not is_in_its_place(effect, place)


def test_no_filter_is_fitted_where_no_force_was_recorded() -> None:
    context: Any = SimpleNamespace(coarse=SimpleNamespace(shots=SimpleNamespace(channel=np.ones(50))))
    with patch("impactcell.discrepancy.laws.standing.REMAINDER_FORMS", {}):
        assert fit_free_forms(context, _leaving(20.0)).alone == ()


@pytest.mark.slow
def test_a_delay_is_not_established_in_the_place_of_a_lag() -> None:
    job = Job(
        "removed", ("force_sensor_lag",), 9_030_008, target=4.0, shots=SHOTS, removed="force_sensor_lag"
    )
    with patch("impactcell.discrepancy.workflow.find_law", lambda *_: None):
        found = investigate(campaign(job, (2.0,)), seed=1, library=("channel_skew", "force_sensor_offset"))
    assert found.selection.nominal.p_value < 0.01
    assert found.verdict == "unknown"
    assert found.added == ()
    outcome = result_document(found)
    assert outcome["outdone"] == {
        "effect": "channel_skew", "form": FORCE_FILTER.equation, "same_place": True
    }  # fmt: skip
    assert "Channel skew comes nearest, but a free function" in outcome["headline"]
