"""Effects between shots beside a further column of `shots.csv` that goes with them, or takes their place."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from impactcell.api.findings import write_findings
from impactcell.campaign import Campaign
from impactcell.discrepancy.workflow import DiscrepancyResult, investigate
from impactcell.records import Capture
from simulator.campaign import make
from simulator.campaign_scenario import CampaignScenario
from tests.discrepancy.study import Job, campaign, recorded, strengths, with_column

pytestmark = pytest.mark.slow

COLUMN = "oil temperature"
FEW = ("friction_drift", "direction_asymmetry", "viscous_friction")
"""What may be named: enough to go wrong, and quick to search."""
DRIFTING = Job("single", ("friction_drift",), 8311, strength=1.5, shots=60)


def told(data: Campaign, column: Callable[[Capture], float]) -> Campaign:
    """Give each shot of a campaign a value of the column."""
    return replace(data, shots=tuple(replace(shot, covariates={COLUMN: column(shot)}) for shot in data.shots))


def warming(law: Callable[[float], float]) -> Campaign:
    """Make a campaign whose friction goes with a temperature that rises from shot to shot."""
    data = with_column(Job("removed", (), 8312, shots=60), COLUMN, 20.0, 40.0, law)
    rng = np.random.default_rng(1)
    order = sorted(data.shots, key=lambda shot: shot.covariates[COLUMN] + 2.0 * rng.standard_normal())
    return replace(data, shots=tuple(replace(shot, cycle=i) for i, shot in enumerate(order, start=1)))


def outcome(data: Campaign) -> DiscrepancyResult:
    return investigate(data, seed=1, library=FEW)


def test_what_rises_with_the_shots_as_a_drift_does_is_tied_with_it(tmp_path: Path) -> None:
    data = told(campaign(DRIFTING), lambda shot: 20.0 + 0.3 * shot.cycle)
    write_findings(outcome(data), data, tmp_path, "a campaign")
    found = json.loads((tmp_path / "result.json").read_text())
    (effect,) = found["effects"]
    (rival,) = effect["tied_with"]
    assert (found["verdict"], effect["effect"]) == ("tied", "friction_drift")
    assert rival.startswith("free_friction_over_column_oil_temperature_")
    assert "friction drift or friction over column oil_temperature, which these shots" in found["headline"]
    (experiment,) = found["next_experiment"]
    assert experiment["separates"] == ["friction_drift", rival]
    assert experiment["setting"] == "the same settings again, column oil temperature in another order"
    german = (tmp_path / "report.de.html").read_text()
    assert "die Spalte oil temperature in anderer Reihenfolge" in german
    assert "Reibung über der Spalte oil_temperature" in german


@pytest.mark.slow
def test_a_column_that_rises_with_the_shots_takes_no_name_by_what_a_curve_finds_in_their_scatter() -> None:
    """A curve instead of a straight line had five numbers here, and left factors a quarter narrower."""
    plan = CampaignScenario.model_validate(
        {
            "format": 1,
            "seed": 8,
            "plant": {"stiffness_n_per_m": 4e5, "damping_n_s_per_m": 300.0, "mu_s": 0.25, "ratio": 0.8},
            "velocities_mm_per_min": [2500.0, 4000.0, 5500.0],
            "masses_kg": [7.0, 8.5, 11.0],
            "sensors": {
                "force": {"rate_hz": 10000.0, "noise_std": 0.4},
                "position": {"rate_hz": 10000.0, "noise_std": 1.5e-6},
            },
            "hide": ["friction_drift"],
        }
    )
    rng = np.random.default_rng(2)
    data = told(
        recorded(plan, make(plan)[1]), lambda shot: 20.0 + 0.4 * shot.cycle + 0.3 * rng.standard_normal()
    )
    found = investigate(data, library=FEW)
    assert (found.verdict, found.added) == ("tied", ("friction_drift",))


def test_friction_that_goes_with_a_rising_temperature_is_no_drift() -> None:
    found = outcome(warming(lambda temperature: 1.0 - 0.006 * (temperature - 30.0)))
    assert found.added == ()
    assert found.selection.outdone is not None
    assert found.selection.outdone.effect == "friction_drift"
    assert found.law is not None
    assert (found.law.term.form.covariate, found.law.refused) == (COLUMN, "")


@pytest.mark.parametrize("slope", [0.0, 0.006])
def test_a_drift_stands_beside_a_column_of_an_order_of_its_own(slope: float) -> None:
    job = replace(DRIFTING, kind="removed")
    found = outcome(with_column(job, COLUMN, 20.0, 40.0, lambda column: 1.0 + slope * (column - 30.0)))
    assert found.added == ("friction_drift",)
    assert found.conclusion.ties == {"friction_drift": ()}


def test_a_drift_is_as_large_as_it_is_beside_friction_that_goes_with_a_column() -> None:
    """The column's part is no scatter of the drift: without it the interval was four times as wide."""
    job = replace(DRIFTING, kind="removed", seed=8313)
    found = outcome(with_column(job, COLUMN, 20.0, 40.0, lambda column: 1.0 + 0.006 * (column - 30.0)))
    (drift,) = [one for one in found.stated_parameters if one.effect]
    true = strengths("friction_drift", DRIFTING.strength)["relative_change"]
    assert drift.low < true < drift.high
    assert drift.high - drift.low < 0.03


def test_a_column_of_few_values_takes_no_name() -> None:
    found = outcome(told(campaign(DRIFTING), lambda shot: float(shot.cycle > 30)))
    assert found.added == ("friction_drift",)
    assert found.conclusion.ties == {"friction_drift": ()}
