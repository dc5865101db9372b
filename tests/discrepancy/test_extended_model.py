"""The model that the workflow leaves: what shots tell nothing of is as it was, or there is no whole model."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from impactcell import campaign as campaigns
from impactcell.api.extended_model import write_extended_model
from impactcell.api.finding_files import write_files
from impactcell.campaign import Campaign, Excitation, Sensor
from impactcell.cli.accept_model import accept_model
from impactcell.cli.discrepancy import discrepancy
from impactcell.discrepancy.workflow import investigate
from impactcell.errors import CampaignError, SettingsError
from impactcell.records import Capture, Channel
from impactcell.settings import read_cell
from impactcell.settings.model_file import read_model
from tests.benchmarks._discrepancy_driven import Job, record
from tests.discrepancy.study import write_blank_report
from tests.discrepancy.test_verdicts import free_slides

pytestmark = pytest.mark.slow

CELL = Path("config/cells/prototype.yaml")


def slides() -> Campaign:
    """Free slides of the cell's part."""
    made = free_slides()[0]
    shots = tuple(replace(shot, mass_kg=18.9) for shot in made.shots)
    return replace(made, shots=shots, columns=("shot", "mass_kg"))


def test_free_slides_leave_the_contact_of_a_cell_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("impactcell.api.findings.write_reports", write_blank_report)
    campaigns.write(slides(), tmp_path / "campaign")
    discrepancy(tmp_path / "campaign", tmp_path / "out", cell=CELL)
    before, after = read_cell(CELL).model, read_model(tmp_path / "out" / "model.extended.yaml")
    assert after.plant.mu_k == pytest.approx(0.2, rel=0.05)
    assert after.plant.mu_k != before.plant.mu_k
    assert after.ratio == pytest.approx(before.ratio, rel=1e-12)
    for name in ("stiffness_n_per_m", "damping_n_s_per_m"):
        assert getattr(after.plant, name) == getattr(before.plant, name)
    assert after.prior == before.prior
    assert after.provenance["not seen in these shots, so as before"] == (
        "stiffness_n_per_m, damping_n_s_per_m, mu_s / mu_k"
    )


def test_free_slides_alone_make_no_model_for_a_cell_and_the_report_offers_none(tmp_path: Path) -> None:
    campaigns.write(slides(), tmp_path / "campaign")
    discrepancy(tmp_path / "campaign", tmp_path / "out")
    extended = tmp_path / "out" / "model.extended.yaml"
    with pytest.raises(SettingsError, match=r"model\.extended\.yaml:.*no cell can run with it.*--cell"):
        accept_model(CELL, extended)
    assert "mu_k: 0.2" in extended.read_text(encoding="utf-8")
    assert "stiffness" not in extended.read_text(encoding="utf-8").partition("plant:")[2]
    assert json.loads((tmp_path / "out" / "result.json").read_text())["model"] == "model.extended.yaml"
    for name, unseen in (("report.html", "stiffness, damping, µs/µk"), ("report.de.html", "Steifigkeit,")):
        page = (tmp_path / "out" / name).read_text(encoding="utf-8")
        assert "model accept" not in page
        assert unseen in page


def slides_against_a_force(mass_kg: float) -> Campaign:
    """Free slides of 12.6 kg parts with viscous friction of 85 N s/m that state another mass, or none."""
    rng, viscous, captures = np.random.default_rng(4), 85.0 / 12.6, []
    for number in range(1, 25):
        braking, speed = 9.81 * 0.2 * math.exp(0.005 * rng.standard_normal()), float(rng.uniform(0.15, 0.5))
        stop = math.log1p(viscous * speed / braking) / viscous
        time = np.arange(0.0, stop + 0.02, 1e-3)
        moving, whole = np.minimum(time, stop), speed + braking / viscous
        position = whole / viscous * -np.expm1(-viscous * moving) - braking / viscous * moving
        channel = Channel(time, position + 1e-5 * rng.standard_normal(time.size), 1e-5)
        captures.append(Capture(number, math.nan, mass_kg, None, channel))
    sensors, columns = {"position": Sensor(1000.0, 1e-5)}, ("shot", "mass_kg")
    return Campaign(Excitation.FREE_SLIDE, tuple(captures), columns=columns, sensors=sensors)


def test_a_force_on_slides_of_unknown_mass_is_told_for_a_kilogram_and_no_cell_runs_with_it(
    tmp_path: Path,
) -> None:
    campaigns.write(slides_against_a_force(math.nan), tmp_path / "campaign")
    discrepancy(tmp_path / "campaign", tmp_path / "out")
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert [one["effect"] for one in result["effects"]] == ["viscous_friction"]
    assert any("told for a part of 1 kg; state mass_kg" in note for note in result["notes"])
    with pytest.raises(SettingsError, match="viscous_friction is for a part of 1 kg"):
        accept_model(CELL, tmp_path / "out" / "model.extended.yaml")
    for name, said in (("report.html", "for a part of 1 kg"), ("report.de.html", "Teil von 1 kg, und keine")):
        assert said in (tmp_path / "out" / name).read_text(encoding="utf-8")
    assert result["per_kilogram"] == ["viscous_friction"]
    english, german = ((tmp_path / "out" / name).read_text() for name in ("report.html", "report.de.html"))
    assert "<b>Measure next</b>: the mass of the part, which no slide shows" in english
    assert "<b>Als Nächstes messen</b>: die Masse des Teils, die kein Gleiten zeigt" in german
    assert re.findall(r"shot \d+, [+−]", english)
    assert re.findall(r"(?:shot|Stoß) \d+, 1 kg", english + german) == []


def test_the_mass_of_slides_is_the_cells_where_they_state_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("impactcell.api.findings.write_reports", write_blank_report)
    stated = read_cell(CELL).settings.part.mass_kg
    assert stated is not None
    effects = []
    for mass_kg in (stated, math.nan):
        campaigns.write(slides_against_a_force(mass_kg), tmp_path / f"{mass_kg}")
        discrepancy(tmp_path / f"{mass_kg}", tmp_path / f"out {mass_kg}", cell=CELL)
        effects.append(read_model(tmp_path / f"out {mass_kg}" / "model.extended.yaml").plant.effects)
    assert effects[0] == effects[1]
    assert (
        f"the mass of 24 slides is not stated: {stated:g} kg, as the cell has it" in capsys.readouterr().err
    )


def test_a_model_with_a_force_says_nothing_of_slides_without_mass() -> None:
    model = read_model(Path("config/models/prototype.yaml"))
    viscous = {"viscous_friction": {"viscous_coefficient_n_s_per_m": 85.0}}
    data = slides_against_a_force(math.nan)
    with pytest.raises(
        CampaignError, match="viscous_friction of the nominal model is a force: state mass_kg"
    ):
        investigate(data, plant=replace(model.plant, effects=viscous))
    some = tuple(replace(one, mass_kg=12.6) if one.cycle == 3 else one for one in data.shots)
    found = investigate(replace(data, shots=some), plant=replace(model.plant, effects=viscous))
    assert found.verdict == "no_gap"
    assert any("mass of 23 of 24 slides is not stated" in note for note in found.prepared.notes)


def test_a_driven_record_leaves_the_contact_of_a_plant_as_it_was(tmp_path: Path) -> None:
    model = read_model(Path("config/models/prototype.yaml"))
    nominal = replace(model, plant=replace(model.plant, effects={}))
    data = record(Job("", 7302, coloured=True))
    found = investigate(data, library=(), plant=nominal.plant)
    write_extended_model(found, data, "a record", nominal, tmp_path / "extended.yaml")
    extended = read_model(tmp_path / "extended.yaml")
    assert extended.plant.stiffness_n_per_m == nominal.plant.stiffness_n_per_m
    assert extended.plant.damping_n_s_per_m == nominal.plant.damping_n_s_per_m
    assert extended.prior.stiffness_std_n_per_m == nominal.prior.stiffness_std_n_per_m
    assert extended.plant.mu_k != nominal.plant.mu_k
    assert extended.prior.ratio_std != nominal.prior.ratio_std


def test_a_run_takes_nothing_away_that_an_earlier_one_or_somebody_has_put_there(tmp_path: Path) -> None:
    """A law was deleted by the run whose model names it, and with it a report that was kept by hand."""
    output = tmp_path / "found"
    output.mkdir()
    kept = ("law_of_drag_over_speed_01234567.py", "report.2024-05.html", "notes.txt")
    for name in (*kept, "report.html"):
        (output / name).write_text("of before", encoding="utf-8")

    def write(beside: Path) -> None:
        for name in ("result.json", "model.extended.yaml", "report.html", "report.de.html", "law_of_it.py"):
            (beside / name).write_text("of now", encoding="utf-8")

    write_files(output, write)
    texts = {file.name: file.read_text(encoding="utf-8") for file in output.iterdir()}
    assert {name for name, text in texts.items() if text == "of before"} == set(kept)
    assert len(texts) == len(kept) + 5
