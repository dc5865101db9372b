"""What a next experiment promises holds when it is simulated."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

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
from impactcell.discrepancy.search import experiment_design
from impactcell.discrepancy.search.experiment_design import (
    UNLIMITED,
    propose_experiments,
    simulated_separation,
)
from impactcell.records import MM_PER_MIN
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


def test_a_setting_that_keeps_nothing_of_its_promise_is_not_proposed(
    rivals: tuple[Problem, Fit, Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, viscous, drag = rivals
    monkeypatch.setattr(experiment_design, "simulated_separation", lambda *_: 0.0)
    (proposal,) = propose_experiments(
        problem, viscous, [("viscous_friction", "quadratic_drag", drag)], BATCHES
    )
    assert proposal.shots == 0


def test_a_model_is_not_told_from_itself_and_the_less_the_more_friction_scatters(
    rivals: tuple[Problem, Fit, Fit],
) -> None:
    problem, viscous, drag = rivals
    shot = problem.shots.items[0]
    assert simulated_separation(problem, viscous, viscous, shot) == 0.0
    steady, scattered = (
        simulated_separation(problem, replace(viscous, spread=spread), replace(drag, spread=spread), shot)
        for spread in (0.001, 0.2)
    )
    assert steady > scattered
    count = experiment_design._shots_needed(0.5)
    assert (
        norm.cdf(math.sqrt(count) * 0.5 - norm.ppf(0.975))
        >= 0.9
        > norm.cdf(math.sqrt(count - 1) * 0.5 - norm.ppf(0.975))
    )


def test_where_a_setting_takes_many_shots_another_is_looked_at() -> None:
    """Two were reckoned for a setting that took 121 when simulated, and two do it at the next one."""
    tapped = prepare(make("surface_tilt", shots=12))
    problem = Problem(shot_set(tapped, np.arange(12), sensor_noise(tapped).noise_std), len(tapped.batches))
    nominal = fit_nominal(problem)
    tilt, asymmetry = (fitted(problem, nominal, name) for name in ("surface_tilt", "direction_asymmetry"))
    (proposal,) = propose_experiments(
        problem, tilt, [("surface_tilt", "direction_asymmetry", asymmetry)], tapped.batches
    )
    assert "mm/min" in proposal.setting
    assert 2 <= proposal.shots <= 6


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
