"""What a next experiment promises holds when it is simulated."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from impactcell import campaign as campaigns
from impactcell.campaign import Campaign, Excitation
from impactcell.cli.discrepancy import discrepancy
from impactcell.discrepancy.data import CellLimits, PreparedCampaign, PreparedShot
from impactcell.discrepancy.data.noise_floor import sensor_noise
from impactcell.discrepancy.data.prepared_campaign import prepare, shot_set
from impactcell.discrepancy.data.shot_making import STRATEGIES
from impactcell.discrepancy.model.initial_guess import fit_nominal
from impactcell.discrepancy.model.least_squares import Fit
from impactcell.discrepancy.model.problem import Problem
from impactcell.discrepancy.report.result import experiments
from impactcell.discrepancy.search import experiment_design
from impactcell.discrepancy.search.experiment_design import UNLIMITED, propose_experiments
from impactcell.discrepancy.search.further_shots import FurtherShots
from impactcell.discrepancy.search.separation import Pair
from impactcell.discrepancy.search.tie_redraws import is_told, share_told
from impactcell.records import MM_PER_MIN
from simulator.campaign import make as simulate
from simulator.campaign_scenario import CampaignScenario
from tests.discrepancy import study
from tests.discrepancy.test_convergence import fitted
from tests.discrepancy.test_workflow import make

pytestmark = pytest.mark.slow

BATCHES = ("7", "9", "11")


@pytest.fixture(scope="module")
def prepared() -> PreparedCampaign:
    """Few shots in two batches."""
    return prepare(make("viscous_friction", shots=12))


@pytest.fixture(scope="module")
def rivals(prepared: PreparedCampaign) -> tuple[Problem, Fit, Fit]:
    """Viscous friction and a drag fitted to the same few shots."""
    shots = shot_set(prepared, np.arange(12), sensor_noise(prepared).noise_std)
    problem = Problem(shots, len(prepared.batches))
    nominal = fit_nominal(problem)
    return problem, fitted(problem, nominal, "viscous_friction"), fitted(problem, nominal, "quadratic_drag")


def test_viscous_friction_and_drag_are_told_apart_by_a_setting_and_its_shots(
    rivals: tuple[Problem, Fit, Fit],
) -> None:
    problem, viscous, drag = rivals
    (proposal,) = propose_experiments(
        problem, viscous, [("viscous_friction", "quadratic_drag", drag)], BATCHES
    )
    assert proposal.shots >= 2
    assert "mm/min" in proposal.setting
    assert proposal.power >= 0.9


@pytest.mark.parametrize("rule", ["share_told", "is_told"])
def test_a_setting_that_keeps_nothing_of_its_promise_is_not_proposed(
    rivals: tuple[Problem, Fit, Fit], monkeypatch: pytest.MonkeyPatch, rule: str
) -> None:
    """Neither by linearised redraws nor by shots that are simulated and fitted to."""
    problem, viscous, drag = rivals
    monkeypatch.setattr(experiment_design, rule, lambda *_: 0.0)
    (proposal,) = propose_experiments(
        problem, viscous, [("viscous_friction", "quadratic_drag", drag)], BATCHES
    )
    assert proposal.shots == 0
    assert math.isnan(proposal.power)
    assert experiments([proposal])[0]["power"] is None


def test_a_model_is_not_told_from_itself(rivals: tuple[Problem, Fit, Fit]) -> None:
    problem, viscous, _ = rivals
    pair = Pair.of(problem, viscous, viscous)
    new = FurtherShots(pair, [replace(problem.shots.items[0], group=-1)]).about_refit(4)
    kind, groups = np.zeros(4, dtype=int), np.full(4, -1)
    assert share_told(pair, new, kind, groups, 100, np.random.default_rng(0)) == 0.0


@pytest.fixture(scope="module")
def tilted() -> tuple[Problem, Fit, Fit, PreparedCampaign]:
    """A tilt and an asymmetry of direction, fitted to shots of which few go in one of the directions."""
    plan = study.scenario(study.Job("single", ("surface_tilt",), 720_061, shots=60)).model_dump()
    plan |= {"directions": [1, 1, 1, 1, -1], "replicates": 1}
    scenario = CampaignScenario.model_validate(plan)
    for sensor in ("force", "position", "actuator"):
        plan["sensors"][sensor]["rate_hz"] = 1000.0
    scenario = CampaignScenario.model_validate(plan)
    tapped = prepare(study.recorded(scenario, simulate(scenario)[1]))
    shots = shot_set(tapped, np.arange(45), sensor_noise(tapped).noise_std)
    problem = Problem(shots, len(tapped.batches))
    nominal = fit_nominal(problem)
    tilt, asymmetry = (fitted(problem, nominal, name) for name in ("surface_tilt", "direction_asymmetry"))
    return problem, tilt, asymmetry, tapped


def test_the_shots_proposed_tell_a_tilt_from_an_asymmetry_whichever_is_true(
    tilted: tuple[Problem, Fit, Fit, PreparedCampaign],
) -> None:
    """Fifteen were promised to do it with 91 %, and did not in six of six: the rival was left as it was."""
    problem, tilt, asymmetry, tapped = tilted
    (proposal,) = propose_experiments(
        problem, tilt, [("surface_tilt", "direction_asymmetry", asymmetry)], tapped.batches
    )
    assert proposal.shots > 0
    reach = STRATEGIES[Excitation.TAP].settings_within_reach
    made = dict(reach(problem.shots.items, tilt.shot_parameters.mass_kg, tapped.batches, UNLIMITED))
    kinds = made[proposal.setting]
    items = kinds * (3 * proposal.shots // len(kinds) // 4)
    for pair in (Pair.of(problem, tilt, asymmetry), Pair.of(problem, asymmetry, tilt)):
        told = [is_told(pair, items, np.random.default_rng([41, draw])) for draw in range(8)]
        assert sum(told) >= 5


def test_nothing_is_promised_of_shots_that_a_refitted_rival_absorbs(
    tilted: tuple[Problem, Fit, Fit, PreparedCampaign],
) -> None:
    """In the direction of most shots a tilt and an asymmetry are both one factor of friction."""
    problem, tilt, asymmetry, _ = tilted
    shot = next(one for one in problem.shots.items if one.direction == 1)
    for true, rival in ((tilt, asymmetry), (asymmetry, tilt)):
        pair = Pair.of(problem, true, rival)
        new = FurtherShots(pair, [replace(shot, group=-1)]).about_refit(15)
        kind = np.zeros(15, dtype=int)
        share = share_told(pair, new, kind, np.full(15, -1), 100, np.random.default_rng(0))
        assert share < 0.1


def test_one_experiment_is_proposed_for_ties_that_it_breaks_together(
    rivals: tuple[Problem, Fit, Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first tie needs four shots of whatever, the second eight: what does for it does for both."""
    problem, viscous, drag = rivals
    least = {"quadratic_drag": 4, "hertz_contact": 8}

    def power(tie: experiment_design._Tie, _place: int, count: int) -> float:
        return 0.95 if count >= least[tie.effects[1]] else 0.3

    monkeypatch.setattr(experiment_design._Tie, "power", power)
    monkeypatch.setattr(experiment_design._Tie, "is_told", lambda *_: True)
    monkeypatch.setattr(experiment_design._Tie, "screened", lambda _: [(2, 5), (3, 0)])
    ties = [("viscous_friction", rival, drag) for rival in least]
    proposals = propose_experiments(problem, viscous, ties, BATCHES)
    assert [one.effects[1] for one in proposals] == [*least]
    assert [one.shots for one in proposals] == [8, 8]
    assert len({one.setting for one in proposals}) == 1


def settings(
    shots: Sequence[PreparedShot], limits: CellLimits = UNLIMITED, masses_kg: Sequence[float] = (1.0,)
) -> list[str]:
    """Settings of a next experiment, in words."""
    reach = STRATEGIES[Excitation.TAP].settings_within_reach(shots, np.array(masses_kg), BATCHES, limits)
    return [words for words, _ in reach]


def test_a_batch_is_called_by_its_name(prepared: PreparedCampaign) -> None:
    """With batches 2 and 1, in this order, an operator was told to repeat the wrong one."""
    assert [words for words in settings(prepared.shots) if "batch" in words] == [
        "batch 7 again, after the others",
        "batch 9 again, after the others",
    ]


def test_no_experiment_is_proposed_that_the_cell_cannot_make(prepared: PreparedCampaign) -> None:
    fastest, heaviest = (
        max(getattr(shot, name) for shot in prepared.shots) for name in ("velocity_m_s", "mass_kg")
    )
    fast, heavy = f"{1.3 * fastest / MM_PER_MIN:.0f} mm/min", f"{1.5 * heaviest:.3g} kg"
    anywhere = settings(prepared.shots)
    assert any(fast in words for words in anywhere)
    assert any(heavy in words for words in anywhere)
    limits = CellLimits(max_velocity_m_s=1.1 * fastest, mass_kg=heaviest)
    here = settings(prepared.shots, limits)
    assert not any(fast in words or heavy in words for words in here)
    assert any(f"{1.1 * fastest / MM_PER_MIN:.0f} mm/min" in words for words in here)


def test_a_part_is_struck_from_where_it_was_struck_or_where_the_cell_says_it_can_be(
    prepared: PreparedCampaign,
) -> None:
    shots = [replace(shot, direction=1) for shot in prepared.shots]
    assert not any("direction -1" in words for words in settings(shots))
    assert any("direction -1" in words for words in settings(shots, CellLimits(both_ends=True)))


def test_a_setting_in_one_direction_has_its_twin_in_both(prepared: PreparedCampaign) -> None:
    reach = STRATEGIES[Excitation.TAP].settings_within_reach(prepared.shots, np.ones(1), BATCHES, UNLIMITED)
    made = dict(reach)
    one_way = [words for words in made if "direction +1" in words]
    assert one_way
    for words in one_way:
        twin = made[words.replace("direction +1", "half of them in each direction")]
        assert [shot.direction for shot in twin] == [1, -1]
        (one,) = made[words]
        assert {(shot.velocity_m_s, shot.mass_kg, shot.dwell_s) for shot in twin} == {
            (one.velocity_m_s, one.mass_kg, one.dwell_s)
        }
    shots = [replace(shot, direction=1) for shot in prepared.shots]
    assert not any("each direction" in words for words in settings(shots))
    assert any("each direction" in words for words in settings(shots, CellLimits(both_ends=True)))


def test_shots_that_are_added_come_after_the_others_and_join_those_of_their_settings(
    prepared: PreparedCampaign,
) -> None:
    reach = STRATEGIES[Excitation.TAP].settings_within_reach(prepared.shots, np.ones(1), BATCHES, UNLIMITED)
    last = max(prepared.shots, key=lambda shot: shot.record)
    there = {(shot.velocity_m_s, shot.mass_kg, shot.direction): shot.group for shot in prepared.shots}
    joined = 0
    for words, made in reach:
        for shot in made:
            assert shot.record == last.record
            assert words.startswith("batch") or shot.batch == last.batch
            known = there.get((shot.velocity_m_s, shot.mass_kg, shot.direction))
            joined += known is not None
            assert shot.group == known if known is not None else shot.group not in there.values()
    assert joined


def test_a_mass_that_nobody_states_is_that_of_the_cell_or_the_fitted_one(prepared: PreparedCampaign) -> None:
    """Where nobody did, 1400 mm/min and 1 kg was proposed."""
    shots = [replace(shot, mass_kg=math.nan) for shot in prepared.shots]
    fitted = settings(shots, masses_kg=[18.6, 18.8, 19.3])
    assert {words.split(", ")[1] for words in fitted if "mm/min" in words} == {"18.8 kg", "28.2 kg"}
    stated = settings(shots, CellLimits(mass_kg=20.0), masses_kg=[18.6, 18.8, 19.3])
    assert {words.split(", ")[1] for words in stated if "mm/min" in words} == {"20 kg"}


def test_the_cell_file_says_what_can_be_struck(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    campaigns.write(make(shots=12), tmp_path / "campaign")
    told: list[CellLimits] = []

    def investigate(_campaign: Campaign, *, limits: CellLimits, **_: object) -> None:
        told.append(limits)
        raise KeyboardInterrupt

    monkeypatch.setattr("impactcell.cli.discrepancy.investigate", investigate)
    for cell in (None, Path("config/cells/prototype.yaml")):
        with pytest.raises(KeyboardInterrupt):
            discrepancy(tmp_path / "campaign", tmp_path / "out", cell=cell)
    unknown, known = told
    assert math.isinf(unknown.max_velocity_m_s)
    assert math.isnan(unknown.mass_kg)
    assert known.max_velocity_m_s == pytest.approx(0.1)
    assert (known.mass_kg, known.both_ends) == (18.9, False)
