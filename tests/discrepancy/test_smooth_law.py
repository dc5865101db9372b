"""A smooth force of velocity and position that no function in one place will do for, told as a table."""

import csv
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from impactcell.api.machine_findings import write_machine_findings
from impactcell.discrepancy.machine import (
    MachineFinding,
    MachineLaw,
    NumberPrior,
    investigate_machine,
    motions,
    simulate_held_out,
)
from impactcell.discrepancy.machine.laws import law_search
from impactcell.discrepancy.machine.laws.law_refusal import GIVES_ENERGY, NOT_IN_BLOCKS, not_in_one_place
from impactcell.discrepancy.machine.laws.smooth_law import SmoothLaw, smooth_law
from impactcell.discrepancy.report.german_reasons import reason
from impactcell.records import Samples
from tests.discrepancy.smooth_slide import SLIDE, Law, slide, wandering

pytestmark = pytest.mark.slow

NEAR = 0.02
"""Share of the ranges within which a state of the table was met."""


def thicker_to_the_right(position: Samples, velocity: Samples) -> Samples:
    """Damping by a film that is thicker to the right, less to the left: nothing of either alone."""
    return -6.0 * position * velocity


@pytest.fixture(scope="module", params=[wandering, thicker_to_the_right], ids=lambda law: law.__name__)
def found(request: pytest.FixtureRequest) -> tuple[Law, MachineFinding]:
    return request.param, investigate_machine(slide(request.param, 4), SLIDE)


def law_of(finding: MachineFinding) -> MachineLaw:
    assert finding.law is not None
    return finding.law


def met(finding: MachineFinding) -> tuple[Samples, Samples]:
    states = motions(finding)
    return np.concatenate([one.position for one in states]), np.concatenate([one.velocity for one in states])


def test_it_is_proposed_where_no_function_in_one_place_will_do(found: tuple[Law, MachineFinding]) -> None:
    _, finding = found
    law = law_of(finding)
    assert finding.verdict == "unknown"
    assert not finding.established
    assert law.place == "law_of_force_over_velocity_and_position"
    assert law.choice is None
    assert law.fall.low > 0.0
    assert law.fall.after < 1.2 < finding.fall.before


def test_held_out_records_are_simulated_better_with_it(found: tuple[Law, MachineFinding]) -> None:
    _, finding = found
    simulated = law_of(finding).simulated
    assert simulated is not None
    without, with_it = simulated
    assert with_it.rmse < without.rmse
    assert simulate_held_out(finding, finding.final).rmse == pytest.approx(without.rmse, rel=0.02)


def test_it_is_the_force_that_acts_and_its_band_holds_it(found: tuple[Law, MachineFinding]) -> None:
    """About its mean, which the free constant force takes up; where the records have been."""
    truth, finding = found
    position, velocity = met(finding)
    middle = float(np.mean(truth(position, velocity)))
    told, true, half = [], [], []
    for place, curve in law_of(finding).slices:
        for u, value, high in zip(curve.covariate, curve.function, curve.high, strict=True):
            away = np.hypot((position - place) / np.ptp(position), (velocity - u) / np.ptp(velocity))
            if away.min() < NEAR:
                told.append(value)
                half.append(high - value)
                true.append(float(truth(np.array([place]), np.array([u]))[0]) - middle)
    off = np.array(told) - np.mean(told) - (np.array(true) - np.mean(true))
    assert len(off) > 500
    assert np.sqrt(np.mean(off**2)) < 0.2 * np.std(true)
    assert np.mean(np.abs(off) <= half) > 0.9


def test_it_is_handed_over_as_a_table(found: tuple[Law, MachineFinding], tmp_path: Path) -> None:
    truth, finding = found
    write_machine_findings(finding, slide(truth, 4), tmp_path / "found", "slide")
    told: dict[str, Any] = json.loads((tmp_path / "found" / "result.json").read_text(encoding="utf-8"))["law"]
    assert told["place"] == "s(q', q)"
    assert told["covariates"] == [*told["tested_range"]] == ["velocity", "position"]
    assert told["form"] == "spline only"
    assert told["equation"] == "s(u, w), u the velocity and w the position"
    assert told["file"] is None
    assert told["simulation"]["rmse"]["after"] < told["simulation"]["rmse"]["before"]
    with (tmp_path / "found" / told["table"]).open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["velocity_m_per_s", "position_m", "force_n", "low_n", "high_n"]
    law, chosen = law_of(finding), law_of(finding).model.terms[-1]
    assert len(rows) == sum(curve.covariate.size for _, curve in law.slices)
    assert all(float(row["low_n"]) < float(row["force_n"]) < float(row["high_n"]) for row in rows)
    assert chosen.choice.reach is not None
    assert told["tested_range"]["velocity"]["high"] == pytest.approx(chosen.choice.reach.speed, rel=1e-5)


@pytest.mark.parametrize(
    ("page", "said"),
    [
        ("report.html", ("a smooth force, known as a table", " and position from ",
                         "no function in one place")),
        ("report.de.html", ("eine glatte Kraft, bekannt als Tabelle", "u = Geschwindigkeit und w = Position",
                            " und Position von ", "Keine Funktion an einer einzigen Stelle")),
    ],
)  # fmt: skip
def test_the_report_draws_it_at_three_places(
    found: tuple[Law, MachineFinding], tmp_path: Path, page: str, said: tuple[str, ...]
) -> None:
    truth, finding = found
    write_machine_findings(finding, slide(truth, 4), tmp_path / "found", "slide")
    text = (tmp_path / "found" / page).read_text(encoding="utf-8")
    for words in said:
        assert words in text
    assert text.count("w = ") >= 3
    assert "law_of_force_over_velocity_and_position.csv" in text


def test_nothing_hidden_has_none() -> None:
    finding = investigate_machine(slide(lambda q, v: 0.0 * q * v, 4), SLIDE)
    assert finding.verdict == "no_gap"
    assert finding.law is None


def test_a_number_that_is_off_is_told_in_its_place() -> None:
    held = replace(SLIDE, inertia=NumberPrior(1.7, 0.0))
    finding = investigate_machine(slide(lambda q, v: 0.0 * q * v, 4), held)
    assert finding.law is None
    assert "another mass" in finding.law_refused


def test_one_that_gives_energy_is_refused() -> None:
    """It pushes along the motion with more than friction takes, at every other place."""
    finding = investigate_machine(slide(lambda q, v: 6.0 * np.sin(30.0 * q) * np.tanh(v / 0.2), 4), SLIDE)
    assert math.isfinite(finding.fall.after)
    assert finding.law is None
    assert finding.law_refused == GIVES_ENERGY


@pytest.mark.parametrize(
    "fault", ["on held-out blocks the gap does not fall by more than chance", NOT_IN_BLOCKS]
)
def test_one_that_is_refused_is_not_said_to_explain_what_remains(
    monkeypatch: pytest.MonkeyPatch, fault: str
) -> None:
    """It was: "a smooth force ... explains what remains as well as a law in one place"."""

    def hold_it_to_nothing(*arguments: Any) -> SmoothLaw:
        smooth = smooth_law(*arguments)
        return replace(smooth, gains=np.zeros_like(smooth.gains)) if fault == NOT_IN_BLOCKS else smooth

    monkeypatch.setattr(law_search, "smooth_law", hold_it_to_nothing)
    monkeypatch.setattr(law_search, "refusal_of", lambda *_: fault)
    finding = investigate_machine(slide(wandering, 4), SLIDE)
    assert finding.law is None
    assert finding.law_refused == not_in_one_place(fault)
    assert "explains" not in finding.law_refused
    language, german = reason(finding.law_refused)
    assert language == "de"
    assert german.startswith(
        "neben einer glatten Kraft über Ort und Geschwindigkeit braucht der Rest kein Gesetz"
    )
