"""The discrepancy workflow from campaign to verdict, on effects hidden by the simulator's own plant."""

import functools
import json
import re
from collections.abc import Container
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import impactcell
from impactcell import campaign as campaigns
from impactcell.campaign import Campaign
from impactcell.cli.discrepancy import discrepancy
from impactcell.discrepancy.data.noise_floor import replicate_spread
from impactcell.discrepancy.model.least_squares import Fit, fit
from impactcell.discrepancy.model.problem import remove_jumps
from impactcell.discrepancy.model.shot_fits import fit_shot_parameters
from impactcell.discrepancy.report.result import json_text, result_document
from impactcell.discrepancy.search.candidate_fits import finalists, is_at_bound
from impactcell.discrepancy.search.context import SearchContext
from impactcell.discrepancy.search.indistinguishability import (
    are_indistinguishable,
    evaluate_out_of_shot,
    folds,
)
from impactcell.discrepancy.workflow import DiscrepancyResult, investigate
from impactcell.errors import CampaignError
from impactcell.physics import Plant
from impactcell.records import Channel
from impactcell.settings.model_file import read_model
from tests.between_workers import computed_once
from tests.discrepancy import study

STRENGTH = 1.0


def make(*hidden: str, seed: int = 3, shots: int = 36) -> Campaign:
    return study.quick_campaign(study.Job("single", hidden, seed, STRENGTH, shots=shots))


@functools.cache
def investigated(*hidden: str, shots: int = 36) -> DiscrepancyResult:
    """What comes of a campaign, once for all tests that look at it."""
    name = "-".join(("investigated", *hidden, str(shots)))
    return computed_once(name, lambda: study.name_effects(make(*hidden, shots=shots)))


def answer(found: DiscrepancyResult) -> tuple[str, set[str]]:
    tied = {one for rivals in found.selection.ties.values() for one in rivals}
    return found.verdict, {*found.added, *tied}


@pytest.mark.slow
def test_nothing_is_named_where_nothing_is_hidden() -> None:
    found = investigate(make())
    assert found.verdict == "no_gap"
    assert found.validation.held_out.before.trace == pytest.approx(1.0, abs=0.03)
    assert np.log(found.parameters[0].value) == pytest.approx(
        np.log(study.scenario(study.Job("single", (), 3)).plant.stiffness_n_per_m), rel=1e-4
    )


@pytest.mark.parametrize("library", [(), ("batch_shift",)])
def test_a_library_of_which_no_shot_can_test_anything_names_nothing(library: tuple[str, ...]) -> None:
    found = investigate(make(shots=20), library=library)
    assert (found.verdict, found.added) == ("no_gap", ())


@pytest.mark.slow
@pytest.mark.parametrize(
    "effect", ["viscous_friction", "channel_skew", "position_sensor_lag", "friction_drift"]
)
def test_a_hidden_effect_is_named_with_its_parameters(effect: str) -> None:
    found = investigate(make(effect))
    assert effect in answer(found)[1]
    assert found.added[0] == effect
    (truth,) = study.strengths(effect, STRENGTH).values()
    (estimate,) = [one for one in found.parameters if one.effect == effect]
    half = 0.5 * (estimate.high - estimate.low)
    assert abs(estimate.value - truth) < 3.0 * half
    assert found.validation.held_out.after.trace < 1.05


@pytest.mark.slow
def test_a_confound_that_is_lost_on_few_samples_is_tied_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    def without_mass(context: SearchContext, rough: list[Fit], given: Container[str]) -> list[Fit]:
        return [one for one in finalists(context, rough, given) if one.effects[-1] != "mass_error"]

    monkeypatch.setattr("impactcell.discrepancy.search.one_more.finalists", without_mass)
    found = investigate(make("mass_error", shots=18))
    assert found.verdict == "tied"
    assert answer(found)[1] == {"mass_error", "force_sensor_gain"}


def test_a_jump_at_one_sample_is_no_slope() -> None:
    slope = np.sin(np.linspace(0.0, 6.0, 200))
    jumped = slope.copy()
    jumped[[50, 120]] = 40.0, -900.0
    expected = slope.copy()
    expected[[50, 120]] = 0.0
    assert np.array_equal(remove_jumps(jumped), expected)
    assert np.array_equal(remove_jumps(30.0 * slope), 30.0 * slope)


def test_where_a_step_leaves_the_plant_without_an_answer_there_is_no_slope() -> None:
    slope = np.sin(np.linspace(0.0, 6.0, 200))
    unknown = slope.copy()
    unknown[90:120] = np.nan
    unknown[130] = np.inf
    expected = slope.copy()
    expected[[*range(90, 120), 130]] = 0.0
    assert np.array_equal(remove_jumps(unknown), expected)


def test_likelihood_out_of_shot_is_that_of_a_fit_without_the_shot() -> None:
    found = investigated(shots=20)
    problem, model = found.problem, found.nominal
    inside = model.log_likelihood(problem.shots)
    outside = evaluate_out_of_shot(problem, model).each
    expected, got = [], []
    for fold in folds(problem)[[0, 5, 9]]:
        mine = np.flatnonzero(folds(problem) == fold)
        others = np.setdiff1d(np.arange(problem.count), mine)
        rest = problem.select(others)
        refitted = fit(
            rest,
            model.theta,
            model.shot_parameters.select(others),
            spread=model.spread,
            tolerance=1e-6,
        )
        alone = problem.select(mine)
        start = alone.evaluate(refitted.theta, model.shot_parameters.select(mine), model.spread)
        settled = fit_shot_parameters(alone, start, 8)
        there = replace(
            model, theta=refitted.theta, shot_parameters=settled.shot_parameters, residual=settled.residual
        )
        expected.append((inside[mine] - there.log_likelihood(alone.shots)).sum())
        got.append((inside[mine] - outside[mine]).sum())
    assert np.sum(got) == pytest.approx(np.sum(expected), rel=0.25)
    assert np.sum(got) > 0.1


def test_few_shots_that_decide_are_no_tie() -> None:
    found = investigated(shots=20)
    best = evaluate_out_of_shot(found.problem, found.nominal)
    each = best.each.copy()
    each[:2] -= 400.0
    assert not are_indistinguishable(found.problem, best, replace(best, each=each))
    each[:2] += 390.0
    assert are_indistinguishable(found.problem, best, replace(best, each=each))


def test_an_exact_confound_is_a_tie_and_says_what_breaks_it() -> None:
    found = investigated("mass_error", shots=18)
    assert found.verdict == "tied"
    assert answer(found)[1] == {"mass_error", "force_sensor_gain"}
    assert "weigh the part" in found.experiments[0].setting


def test_intervals_hold_whichever_of_tied_names_is_right() -> None:
    # Named as a gain, a mass that is off makes the contact look so much softer or stiffer.
    found = investigated("mass_error", shots=18)
    assert found.added == ("force_sensor_gain",)
    job = study.Job("single", ("mass_error",), 3, STRENGTH, shots=18)
    truth = study.scenario(job).plant.stiffness_n_per_m
    alone, stated = found.parameters[0], found.stated_parameters[0]
    assert not alone.low <= truth <= alone.high
    assert stated.low <= truth <= stated.high
    assert stated.value == alone.value
    assert result_document(found)["nominal"]["stiffness_n_per_m"]["ci95"] == pytest.approx(
        [stated.low, stated.high], rel=1e-5
    )


@pytest.mark.long
def test_an_exact_confound_beside_a_second_effect_is_a_tie_too() -> None:
    hidden = ("batch_shift", "force_sensor_gain")
    job = study.Job("two", hidden, 50_028, target=4.108, actuator=False)
    found = study.name_effects(study.campaign(job, [1.0751, 0.7086]), seed=job.seed)
    gain = next(one for one in found.added if one != "batch_shift")
    assert {gain, *found.selection.ties[gain]} == {"mass_error", "force_sensor_gain"}
    assert "batch_shift" in found.added


@pytest.mark.long
def test_a_shape_at_the_end_of_its_range_is_not_a_name() -> None:
    # Friction then differs by direction too, for the parts slide apart: that is no name either.
    campaign = make("position_dependent_friction", seed=920030, shots=18)
    library = ("friction_patch", "periodic_friction", "direction_asymmetry", "viscous_friction")
    found = study.name_effects(campaign, library=library)
    assert is_at_bound(found.problem.shots, found.selection.alternatives[0].fit)
    assert answer(found) == ("unknown", set())


@pytest.mark.long
def test_an_effect_of_no_library_is_unknown_and_nothing_is_listed() -> None:
    found = investigated("actuator_vibration", shots=18)
    outcome = result_document(found)
    assert outcome["verdict"] == "unknown"
    assert outcome["effects"] == []
    assert outcome["unexplained"]["phase"] in {"preload", "loading", "unloading"}


@pytest.mark.slow
def test_a_gap_between_shots_is_unknown_with_the_covariate_that_it_goes_with() -> None:
    others = ("friction_drift", "batch_shift", "viscous_friction", "hertz_contact", "friction_patch")
    found = study.name_effects(make("surface_tilt"), library=others)
    assert answer(found) == ("unknown", set())
    assert found.unexplained is not None
    assert found.unexplained.phase == "between_shots"
    assert found.unexplained.depends_on == ("direction",)


@pytest.mark.long
def test_files_are_whole_and_the_same_to_the_byte(tmp_path: Path) -> None:
    given = make("viscous_friction", shots=24)
    campaigns.write(given, tmp_path / "campaign")
    for name in ("one", "two"):
        discrepancy(tmp_path / "campaign", tmp_path / name, seed=5)
    texts = [(tmp_path / name / "result.json").read_bytes() for name in ("one", "two")]
    assert texts[0] == texts[1]
    outcome = json.loads(texts[0])
    assert outcome["effects"][0]["effect"] == "viscous_friction"
    assert sorted(path.name for path in (tmp_path / "one").iterdir()) == [
        "model.extended.yaml",
        "report.de.html",
        "report.html",
        "result.json",
    ]
    assert "viscous_friction" in read_model(tmp_path / "one" / "model.extended.yaml").plant.effects
    page = (tmp_path / "one" / "report.html").read_text()
    assert "viscous friction" in page
    assert "src=" not in page


def test_an_interrupt_leaves_nothing_half_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    campaigns.write(make(shots=12), tmp_path / "campaign")

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("impactcell.api.findings.write_reports", interrupt)
    with pytest.raises(KeyboardInterrupt):
        discrepancy(tmp_path / "campaign", tmp_path / "out")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["campaign"]


def test_one_shot_is_too_few() -> None:
    given = make(shots=12)
    with pytest.raises(CampaignError, match="1 shots are too few"):
        investigate(replace(given, shots=given.shots[:1]))


@pytest.mark.parametrize("channel", ["force", "position"])
def test_a_unit_wrong_by_a_thousand_is_noticed(channel: str) -> None:
    given = make(shots=12)

    def scaled(one: Channel | None) -> Channel | None:
        return None if one is None else replace(one, values=one.values * 1000.0)

    wrong = [replace(shot, **{channel: scaled(getattr(shot, channel))}) for shot in given.shots]
    with pytest.raises(CampaignError, match=f"{channel}_"):
        investigate(replace(given, shots=tuple(wrong)))


def test_a_unit_that_is_wrong_is_told_with_the_campaign_that_has_it(tmp_path: Path) -> None:
    given = make(shots=12)
    wrong = tuple(
        replace(shot, position=replace(shot.position, values=1e3 * shot.position.values))
        for shot in given.shots
        if shot.position is not None
    )
    path = tmp_path / "campaign"
    campaigns.write(replace(given, shots=wrong), path)
    doors = (lambda: discrepancy(path, tmp_path / "out"), lambda: impactcell.discrepancy(path))
    for door in doors:
        with pytest.raises(CampaignError, match=f"^{re.escape(str(path))}: .*check the unit of position_m"):
            door()
    with pytest.raises(CampaignError, match=r"^train and test go with base"):
        impactcell.discrepancy(path, train="1")


@pytest.mark.slow
def test_missing_channels_and_replicates_are_said() -> None:
    given = make(shots=24)
    jittered = [
        replace(shot, actuator=None, force=None, mass_kg=shot.mass_kg * (1.0 + 1e-6 * i))
        for i, shot in enumerate(given.shots)
    ]
    found = investigate(replace(given, shots=tuple(jittered)))
    text = json_text(result_document(found))
    assert "No force channel" in text
    assert "No replicates" in text
    assert result_document(found)["gap"]["parts"]["train"]["before"]["friction_factors"] is None


@pytest.mark.slow
def test_replicate_spread_is_that_of_the_scatter() -> None:
    found = investigate(make(shots=60))
    rng = np.random.default_rng(2)
    drift = np.linspace(-0.05, 0.05, 60)
    spreads = [
        replicate_spread(found.prepared.shots, drift + 0.01 * rng.standard_normal(60), 2).spread
        for _ in range(200)
    ]
    assert np.sqrt(np.mean(np.square(spreads))) == pytest.approx(0.01, rel=0.05)


@pytest.mark.slow
def test_an_effect_of_the_plant_gives_way_to_the_one_that_is_there() -> None:
    """Its velocity runs to its end as its strength comes to nothing: no fault of the new name."""
    plant = Plant(
        7e5, 450.0, 0.2, 0.15,
        effects={"stribeck_friction": {"friction_increase": 0.02, "stribeck_velocity_m_s": 0.05}},
    )  # fmt: skip
    found = investigate(make("quadratic_drag"), plant=plant, library=("quadratic_drag", "viscous_friction"))
    assert answer(found) == ("named", {"quadratic_drag"})
    assert found.conclusion.remaining.explained
    assert is_at_bound(found.problem.shots, found.final)
