"""A law that no catalogue has, of a machine without a cell: scipy's integrator moves it, the records tell."""

import json
import math
import re
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from typer.testing import CliRunner

import impactcell
from impactcell.api.machine_findings import write_machine_findings
from impactcell.campaign import Campaign, Coordinate, Excitation, write
from impactcell.cli.app import app
from impactcell.discrepancy.laws import ATOMS, Shaped
from impactcell.discrepancy.machine import (
    COVARIATES,
    BaseModel,
    FallOfGap,
    MachineFinding,
    NumberPrior,
    OpenLoopError,
    Response,
    TermChoice,
    investigate_machine,
    simulate_held_out,
)
from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.laws import law_proof, law_search
from impactcell.discrepancy.machine.laws.free_splines import FreeSpline
from impactcell.discrepancy.machine.regression.block_sums import LinearFit
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.simulation import held_out as simulation
from impactcell.discrepancy.machine.terms.base_model import LawForm
from impactcell.discrepancy.report import (
    german_machine_sentences,
    german_notes,
    german_reasons,
    machine_result,
    machine_sentences,
)
from impactcell.discrepancy.report.machine_parameters import parameter_rows
from impactcell.errors import CampaignError, SettingsError
from impactcell.german.findings import german_effect, german_headline, with_decimal_commas
from impactcell.records import Capture, Channel
from impactcell.settings.base_model import read_base_model
from tests.discrepancy.test_german_report import Told

COULOMB, CENTRE, WIDTH = 3.0, 0.04, 0.05
"""Friction of the slide [N], and where it is larger, and over what length [m]."""
SLIDE = BaseModel(
    response=Response.FORCE, inertia=NumberPrior(2.0, 0.1), force_offset=NumberPrior(0.0, math.inf)
)
SLIDE_FILE = """\
format: 1
coordinate: translation
excitation: driven
predicts: force
mass_kg: {value: 2.0, std: 0.1}
terms: [coulomb_friction]
nuisances:
  force_offset: {std: free}
"""
NOISE = 2e-5
"""Of the pendulum's angle [rad]."""


@lru_cache
def slide(size: float, noise_n: float = 0.2) -> Campaign:
    """Six paths of a slide whose friction has a bump of so many newtons about one place."""
    rng = np.random.default_rng(11)
    shots = []
    for number in range(1, 7):
        time = np.arange(0.0, 12.0, 4e-3)
        rates = 2.0 * np.pi * rng.uniform(0.3, 1.2, 3)
        angles = rates[:, None] * time + rng.uniform(0.0, 2.0 * np.pi, (3, 1))
        sizes = 0.08 * rng.uniform(0.5, 1.0, 3)
        position = sizes @ np.sin(angles)
        velocity = (sizes * rates) @ np.cos(angles)
        acceleration = -(sizes * rates**2) @ np.sin(angles)
        level = COULOMB + size * np.exp(-0.5 * ((position - CENTRE) / WIDTH) ** 2)
        force = (
            2.0 * acceleration + level * np.tanh(velocity / 1e-3) + noise_n * rng.standard_normal(time.size)
        )
        channels = Channel(time, force, noise_n), Channel(time, position, 1e-7)
        shots.append(Capture(number, math.nan, math.nan, *channels))
    return Campaign(Excitation.DRIVEN, tuple(shots))


@lru_cache
def investigated(size: float) -> MachineFinding:
    return investigate_machine(slide(size), SLIDE)


@pytest.mark.slow
def test_a_bump_of_friction_is_found_at_its_place() -> None:
    law = investigated(0.6).law
    assert law is not None
    assert law.choice is not None
    assert law.choice.law is not None
    assert law.place == "law_of_friction_over_position"
    assert "exp(-(u-c)^2/2l^2)" in (law.choice.law.name, *law.equivalents)
    assert law.fall.after < 1.2 < 2.0 < law.fall.before
    assert law.fall.low > 0.0
    position = np.linspace(-0.1, 0.15, 60)
    truth = 0.6 * np.exp(-0.5 * ((position - CENTRE) / WIDTH) ** 2)
    sizes = [law.model.value(column) for column in law.model.terms[-1].columns]
    parts = [item.values(position, law.choice.law.reference) for item in law.choice.law.terms]
    function = sum(size * part for size, part in zip(sizes, parts, strict=True))
    error = (function - np.mean(function)) - (truth - truth.mean())
    assert np.abs(error).max() < 0.1 * 0.6


@pytest.mark.slow
def test_the_gap_that_is_told_for_a_law_is_that_of_its_file(tmp_path: Path) -> None:
    """Without the bump a free delay takes over some of it, and rows count that know no direction."""
    model = tmp_path / "slide.yaml"
    free = "predicts: position", "force_offset: {std: free}\n  delay_s: {std: 0.002}"
    model.write_text(
        SLIDE_FILE.replace("predicts: force", free[0]).replace("force_offset: {std: free}", free[1])
    )
    campaign = slide(0.6, 0.005)
    base, _ = read_base_model(model)
    finding = investigate_machine(campaign, base)
    law = finding.law
    assert law is not None
    assert finding.final.delay_s < -1e-4
    assert law.model.delay_s == pytest.approx(0.0, abs=3e-5)
    assert law.fall.after < 1.2
    write_machine_findings(finding, campaign, tmp_path / "found", "slide")
    text = (tmp_path / "found" / f"{law.place}.yaml").read_text()
    [told] = re.findall(r"held-out gap after: '?([\d.]+)", text)
    assert float(told) == pytest.approx(law.fall.after, rel=1e-3)
    written, _ = read_base_model(tmp_path / "found" / f"{law.place}.yaml")
    again = investigate_machine(campaign, written)
    assert again.verdict == "no_gap"
    assert again.fall.before == pytest.approx(law.fall.after, rel=0.01)


@pytest.mark.slow
def test_a_law_is_proved_where_the_base_model_has_no_dry_friction() -> None:
    """Rows are weighed by its level, and there was no column for it: a traceback."""
    shots = []
    for shot in slide(0.0).shots:
        force, position = shot.force, shot.position
        assert force is not None
        assert position is not None
        speed = np.gradient(position.values, position.time_s)
        bump = 0.6 * np.exp(-0.5 * ((position.values - CENTRE) / WIDTH) ** 2)
        moved = force.values - COULOMB * np.tanh(speed / 1e-3) + 4.0 * speed + bump
        shots.append(replace(shot, force=replace(force, values=moved)))
    base = replace(SLIDE, terms=(TermChoice("viscous_friction"),))
    law = investigate_machine(replace(slide(0.0), shots=tuple(shots)), base).law
    assert law is not None
    assert law.place == "law_of_force_over_position"
    assert law.fall.after < 1.2 < law.fall.before


@pytest.mark.slow
def test_a_place_that_holds_is_not_lost_to_one_that_helps_in_a_single_block(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    best_spline = law_search.best_spline

    def helping(*given: Any) -> FreeSpline:
        spline = best_spline(*given)
        if spline.form != "friction_over_speed":
            return spline
        gains = np.zeros(spline.gains.size)
        gains[0] = 1e3
        return replace(spline, gains=gains)

    monkeypatch.setattr(law_search, "best_spline", helping)
    law = investigate_machine(slide(0.6), SLIDE).law
    assert law is not None
    assert law.place == "law_of_friction_over_position"
    assert law.rival_places == ("law_of_friction_over_speed",)


@pytest.mark.slow
def test_where_held_out_blocks_do_not_confirm_the_best_place_the_next_is_tried(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of speed the held-out blocks know nothing, whatever the others say; the error is shared by two."""
    best_spline, fall_of_gap = law_search.best_spline, law_search.fall_of_gap
    p_values: list[float] = []

    def misleading(*given: Any) -> FreeSpline:
        spline = best_spline(*given)
        if spline.form != "friction_over_speed":
            return spline
        return replace(spline, gains=1e3 + np.arange(spline.gains.size))

    def with_p_value(*given: Any) -> FallOfGap:
        fall = fall_of_gap(*given)
        return replace(fall, p_value=p_values[-1]) if fall.low > 0.0 else fall

    monkeypatch.setattr(law_search, "best_spline", misleading)
    for module in (law_search, law_proof):
        monkeypatch.setattr(module, "fall_of_gap", with_p_value)
    p_values.append(0.045)
    law = investigate_machine(slide(0.6), SLIDE).law
    assert law is not None
    assert law.place == "law_of_friction_over_position"
    assert law.rival_places == ("law_of_friction_over_speed",)
    p_values.append(0.055)
    finding = investigate_machine(slide(0.6), SLIDE)
    assert finding.law is None
    assert finding.law_refused == "on held-out blocks the gap does not fall by more than chance"


def test_no_law_is_looked_for_where_nothing_remains() -> None:
    finding = investigated(0.0)
    assert finding.verdict == "no_gap"
    assert finding.law is None
    assert not finding.law_refused


def with_law_of(place: str, form: str, amplitude: float = 1.0) -> MachineFinding:
    """Finding of a slide with a law of one atom in a place in the place of its own."""
    finding = investigated(0.6)
    assert finding.law is not None
    [atom] = [atom for atom in ATOMS if atom.name == form]
    choice = TermChoice(f"law_of_{place}", law=LawForm((Shaped((atom,), ((),)),), 0.2))
    size = np.array([amplitude])
    fit = LinearFit(ChosenTerm(choice, 0.0).columns, size, size, size, np.array([False]))
    model = replace(finding.law.model, fit=fit)
    tested = {COVARIATES[place]: (0.0, 0.2)}
    law = replace(finding.law, place=f"law_of_{place}", tested=tested, choice=choice, model=model)
    return replace(finding, law=law)


@pytest.mark.parametrize(
    ("place", "form", "term", "why", "warum"),
    [
        ("friction_over_speed", "u", "viscous friction", "the best term", ""),
        ("friction_over_speed", "u^2", "quadratic drag", "the best term", ""),
        ("friction_over_speed", "1", "Coulomb friction", "the base model has it", "das Grundmodell hat"),
        ("force_over_position", "u", "restoring force", "the best term", ""),
        ("force_over_position", "u^3", "hardening spring", "the best term", ""),
        ("friction_over_load", "u", "load dependent friction", "on these records it looks", "sieht es aus"),
    ],
)
def test_a_law_that_is_a_term_is_called_by_its_name(
    place: str, form: str, term: str, why: str, warum: str
) -> None:
    finding = with_law_of(place, form)
    law = finding.law
    assert law is not None
    reason = finding.steps[-1].reason
    assert reason
    said = machine_sentences.headline(finding)
    assert "nobody had listed" not in said
    assert f", {term}, would take the held-out gap to {law.fall.after:.2f}; it is not named, since " in said
    tried = {trial.term.choice.name for trial in finding.steps[-1].trials}
    known = law.listed in tried
    assert (reason if known else why) in said
    german = german_machine_sentences.headline(finding)
    assert "brächte die Abweichung auf" in german
    assert (german_reasons.reason(reason)[1] if known else warum) in german
    document = machine_result.machine_document(finding)
    assert document["law"]["term"] == law.listed
    assert f"{german_effect(law.listed)} passt dazu, ist aber nicht benannt" in german_headline(document)


def test_a_law_of_powers_can_be_computed_from_what_is_told_of_it() -> None:
    """It was u^2 with an amplitude in N: what u is measured in stood in the law's own file alone."""
    finding = with_law_of("friction_over_speed", "u^2", 3.0)
    law = machine_result.machine_document(finding)["law"]
    assert law["equation"] == "-s(|q'|) sign(q') with s(u) = (u/0.2 m/s)^2, u the speed"
    amplitude, reference = law["parameters"]["amplitude_n"], law["parameters"]["reference"]
    assert (amplitude["unit"], reference["unit"]) == ("N", "m/s")
    assert amplitude["value"] * (0.1 / reference["value"]) ** 2 == pytest.approx(3.0 / 4.0)
    assert "s(u) = (u/0.2 m/s)^2, u the speed" in machine_sentences.headline(finding)
    assert "s(u) = (u/0,2 m/s)^2, u = Geschwindigkeit" in german_machine_sentences.headline(finding)
    rows = parameter_rows((("", law["parameters"]),), Coordinate.TRANSLATION, "de")
    assert [(row["words"], row["unit"]) for row in rows] == [("Amplitude", "N"), ("Bezugswert", "m/s")]


def parameters_of(finding: MachineFinding, form: LawForm) -> dict[str, Any]:
    """Parameters that are written where a finding's law is of another form, with amplitudes of no account."""
    assert finding.law is not None
    assert finding.law.choice is not None
    choice = replace(finding.law.choice, law=form)
    columns = ChosenTerm(choice, 0.0).columns
    size = np.ones(len(columns))
    fit = LinearFit(columns, size, size, size, np.zeros(len(columns), dtype=bool))
    law = replace(finding.law, choice=choice, model=replace(finding.law.model, fit=fit))
    parameters: dict[str, Any] = machine_result.machine_document(replace(finding, law=law))["law"][
        "parameters"
    ]
    return parameters


def test_shapes_of_a_law_have_units_and_no_reference_that_it_has_not() -> None:
    finding = with_law_of("force_over_position", "1")
    [power, decay] = [atom for atom in ATOMS if atom.name in ("u^n", "1/(1+u/l)")]
    for atom, shapes, told in (
        (power, (1.5,), {"exponent": (1.5, "1"), "reference": (0.2, "m")}),
        (decay, (0.03,), {"scale": (0.03, "m")}),
    ):
        shown = parameters_of(finding, LawForm((Shaped((atom,), (shapes,)),), 0.2))
        assert {n: (item["value"], item["unit"]) for n, item in shown.items() if "amplitude" not in n} == told


def test_no_shape_of_a_law_takes_the_name_of_another() -> None:
    """The second term's second scale stood in place of its first, which was lost."""
    finding = with_law_of("force_over_position", "1")
    [decay, step] = [atom for atom in ATOMS if atom.name in ("1/(1+u/l)", "tanh(u/l)")]
    both = (decay, step)
    form = LawForm((Shaped(both, ((0.03,), (0.04,))), Shaped(both, ((0.05,), (0.06,)))), 0.2)
    shown = parameters_of(finding, form)
    told = {name: item["value"] for name, item in shown.items() if "amplitude" not in name}
    assert told == {"scale": 0.03, "scale_2": 0.04, "scale_3": 0.05, "scale_4": 0.06}
    rows = parameter_rows((("", shown),), Coordinate.TRANSLATION, "de")
    assert len({row["words"] for row in rows}) == len(shown)


def test_that_intervals_do_not_include_what_remains_is_german_too() -> None:
    language, german = german_notes.note(machine_result.OPEN_INTERVALS)
    assert language == "de"
    assert german.startswith("Die Intervalle des Benannten schließen nicht ein, was bleibt")


def test_friction_that_gives_energy_and_other_forms_are_no_term() -> None:
    for finding in (
        with_law_of("friction_over_speed", "u", -1.0),
        with_law_of("force_over_position", "u^2"),
        investigated(0.6),
    ):
        assert finding.law is not None
        assert finding.law.listed == ""
        assert "a law that nobody had listed" in machine_sentences.headline(finding)


@pytest.mark.slow
def test_a_law_that_would_give_energy_is_refused() -> None:
    finding = investigated(-3.6)
    assert finding.law is None
    assert "give energy" in finding.law_refused


@pytest.mark.slow
def test_law_is_a_base_model_again_and_leaves_nothing(tmp_path: Path) -> None:
    write(slide(0.6), tmp_path / "campaign")
    (tmp_path / "base.yaml").write_text(SLIDE_FILE, encoding="utf-8")
    command = ["discrepancy", "-q", str(tmp_path / "campaign"), "-o"]
    first = CliRunner().invoke(
        app, [*command, str(tmp_path / "found"), "--base", str(tmp_path / "base.yaml")]
    )
    assert first.exit_code == 0, first.output
    result = json.loads((tmp_path / "found" / "result.json").read_text(encoding="utf-8"))
    law = result["law"]
    assert law["file"] == "law_of_friction_over_position.yaml"
    assert law["tested_range"]["position"]["unit"] == "m"
    assert law["simulation"]["rmse"]["after"] < law["simulation"]["rmse"]["before"]
    page = (tmp_path / "found" / "report.html").read_text(encoding="utf-8")
    assert "A law that nobody had listed" in page
    assert "s(u) less its mean [N]" in page
    german = (tmp_path / "found" / "report.de.html").read_text(encoding="utf-8")
    assert_is_the_same_in_german(page, german)
    assert "-s(q) sign(q&#39;) mit s(u) = " in german
    assert result["headline"].endswith(
        f"gap to {law['held_out']['after']:.2f}: a law that nobody had listed."
    )
    again = CliRunner().invoke(
        app, [*command, str(tmp_path / "again"), "--base", str(tmp_path / "found" / law["file"])]
    )
    assert again.exit_code == 0, again.output
    second = json.loads((tmp_path / "again" / "result.json").read_text(encoding="utf-8"))
    assert second["verdict"] == "no_gap"
    assert second["law"] is None
    assert not list((tmp_path / "again").glob("law_of_*"))


def assert_is_the_same_in_german(english: str, german: str) -> None:
    cells = [re.findall(r'<td class="n">(-?\d[^<]*)', text) for text in (english, german)]
    assert [with_decimal_commas(cell.replace(" to ", " bis ")) for cell in cells[0]] == cells[1]
    reader = Told()
    reader.feed(german)
    said = f" {' '.join(reader.pieces)} "
    for word in ("the", "and", "records", "with", "held", "noise", "gap", "by", "of", "force", "unknown"):
        assert f" {word} " not in said
    assert re.findall(r"\d\.\d", said) == []


def pendulum(force: float) -> Campaign:
    """Six free swings past a place that pushes, so many newton metres over a third of a radian."""
    rng = np.random.default_rng(7)
    shots = []
    for number, amplitude in enumerate(np.linspace(1.4, 0.7, 6), 1):
        time = np.arange(0.0, 8.0, 2e-3)

        def rates(_t: float, state: np.ndarray) -> tuple[float, float]:
            q, v = state
            push = force * math.exp(-0.5 * ((q + 0.36) / 0.24) ** 2)
            return v, (-0.6 * math.sin(q) - 0.002 * math.tanh(v / 0.02) + push) / 0.02

        run = solve_ivp(
            rates, (0.0, 8.0), (amplitude, 0.0), t_eval=time, rtol=1e-8, atol=1e-9, method="LSODA"
        )
        angle = run.y[0] + rng.normal(0.0, NOISE, time.size)
        shots.append(Capture(number, math.nan, math.nan, None, Channel(time, angle, NOISE)))
    return Campaign(Excitation.FREE_SLIDE, tuple(shots), coordinate=Coordinate.ROTATION)


PENDULUM = BaseModel(
    coordinate=Coordinate.ROTATION, inertia=NumberPrior(0.02), gravity_torque=NumberPrior(0.55, math.inf),
    position_offset=NumberPrior(0.0, 0.05), force_offset=NumberPrior(0.0, 0.01),
)  # fmt: skip


@pytest.mark.slow
def test_a_swing_is_simulated_nearer_with_the_law_of_the_place_that_pushes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    simulated: list[FittedModel] = []

    def counted(finding: MachineFinding, model: FittedModel) -> OpenLoopError:
        simulated.append(model)
        return simulate_held_out(finding, model)

    monkeypatch.setattr(law_proof, "simulate_held_out", counted)
    monkeypatch.setattr(law_search, "simulate_held_out", counted)
    monkeypatch.setattr(simulation, "simulate_held_out", counted)
    finding = investigate_machine(pendulum(1e-3), PENDULUM)
    law = finding.law
    assert law is not None
    assert law.place == "law_of_force_over_position"
    without, with_it = (simulate_held_out(finding, model).rmse for model in (law.without, law.model))
    assert with_it < 0.5 * without
    assert with_it < 1.8 * NOISE
    written = machine_result.machine_document(finding)["law"]["simulation"]["rmse"]
    assert written == pytest.approx({"before": without, "after": with_it}, rel=1e-4)
    once = [sum(model is other for other in simulated) for model in (law.without, law.model)]
    assert once == [1, 1]  # for the decision and for what is written


LAW = """\
- term: law_of_friction_over_position
  law:
  - exp(-(u-c)^2/2l^2): {centre: 0.04, scale: 0.05}
"""


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (("over_position", "over_positon"), "did you mean 'law_of_friction_over_position'?"),
        (("exp(-(u-c)^2/2l^2)", "exp(-(u-c)^2/l^2)"), "no function 'exp(-(u-c)^2/l^2)' of u"),
        (("centre: 0.04, ", ""), "takes centre, scale, not scale"),
        (("scale: 0.05", "scale: -0.05"), "scale must be above 0"),
    ],
)
def test_faults_of_a_law_have_line_and_column(tmp_path: Path, changed: tuple[str, str], said: str) -> None:
    terms = "terms:\n- coulomb_friction\n" + LAW.replace(*changed)
    file = tmp_path / "base.yaml"
    file.write_text(SLIDE_FILE.replace("terms: [coulomb_friction]\n", terms), encoding="utf-8")
    with pytest.raises(SettingsError) as caught:
        read_base_model(file)
    assert "base.yaml:8:" in str(caught.value)
    assert said in str(caught.value)


@pytest.mark.slow
def test_findings_of_a_base_model_are_those_of_the_public_function(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text(SLIDE_FILE, encoding="utf-8")
    findings = impactcell.discrepancy(slide(0.6), base=tmp_path / "base.yaml")
    assert findings.verdict == investigated(0.6).verdict
    assert findings.result["law"]["place"] == "-s(q) sign(q')"
    assert findings.write(tmp_path / "found").is_file()
    assert (tmp_path / "found" / findings.result["law"]["file"]).is_file()
    with pytest.raises(CampaignError, match="leave model out"):
        impactcell.discrepancy(slide(0.6), base=tmp_path / "base.yaml", model="model.yaml")
    with pytest.raises(CampaignError, match="go with base"):
        impactcell.discrepancy(slide(0.6), test="1")
