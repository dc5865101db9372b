"""What the discrepancy workflow is given: cells, journals, and data with something wrong or missing."""

import io
import itertools
import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import impactcell
from impactcell import campaign as campaigns
from impactcell.campaign import Campaign, Excitation, Sensor
from impactcell.cli.app import app
from impactcell.cli.discrepancy import discrepancy
from impactcell.discrepancy.data import sensor_noise
from impactcell.discrepancy.data.prepared_campaign import prepare
from impactcell.discrepancy.report.result import result_document
from impactcell.discrepancy.workflow import investigate
from impactcell.errors import CampaignError
from impactcell.journal.store import Journal
from impactcell.journal.stored_forms import MODEL
from impactcell.process.progress import named_steps
from impactcell.records import Capture, Channel
from impactcell.settings.model_file import read_model
from tests.discrepancy.study import strengths, write_blank_report
from tests.discrepancy.test_workflow import make
from tests.snapshots import make_snapshot
from tests.taps import Tap

PROTOTYPE = Path("config/cells/prototype.yaml")


def thinned(channel: Channel | None, every: int, first: int = 0) -> Channel | None:
    if channel is None:
        return None
    return replace(channel, time_s=channel.time_s[first::every], values=channel.values[first::every])


def changed(given: Campaign, change: Callable[[Capture], Capture]) -> Campaign:
    return replace(given, shots=tuple(map(change, given.shots)))


@pytest.mark.slow
def test_the_model_of_a_cell_is_the_nominal_one(tmp_path: Path) -> None:
    campaigns.write(make("viscous_friction", shots=18), tmp_path / "campaign")
    discrepancy(tmp_path / "campaign", tmp_path / "out", cell=PROTOTYPE)
    outcome = json.loads((tmp_path / "out" / "result.json").read_text())
    extended = read_model(tmp_path / "out" / "model.extended.yaml")
    # The cell's model has viscous friction already: it is refitted and stays, and there is nothing to name.
    assert outcome["verdict"] == "no_gap"
    assert extended.name == read_model(Path("config/models/prototype.yaml")).name
    (truth,) = strengths("viscous_friction", 1.0).values()
    fitted = extended.plant.effects["viscous_friction"]["viscous_coefficient_n_s_per_m"]
    assert fitted == pytest.approx(truth, rel=0.05)


@pytest.mark.slow
def test_captures_of_a_journal_are_as_good_as_a_campaign(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("impactcell.api.findings.write_reports", write_blank_report)
    given = make("viscous_friction", shots=18)
    campaigns.write(given, tmp_path / "campaign")
    with Journal(tmp_path / "j", "press-1") as journal:
        for capture in given.shots:
            journal.append(capture, make_snapshot(capture), b"state")
    discrepancy(tmp_path / "campaign", tmp_path / "one")
    discrepancy(None, tmp_path / "two", journal=tmp_path / "j")
    one, two = (json.loads((tmp_path / name / "result.json").read_text()) for name in ("one", "two"))
    assert [effect["effect"] for effect in two["effects"]] == ["viscous_friction"]
    fitted = [run["effects"][0]["parameters"]["viscous_coefficient_n_s_per_m"] for run in (one, two)]
    assert fitted[1]["value"] == pytest.approx(fitted[0]["value"], rel=1e-3)


@pytest.mark.slow
def test_the_model_that_a_journal_was_recorded_with_is_the_nominal_one(tmp_path: Path) -> None:
    model = read_model(Path("config/models/prototype.yaml"))
    with Journal(tmp_path / "j", "press-1") as journal:
        journal.store_model(MODEL.dumps(model))
        for capture in make("viscous_friction", shots=18).shots:
            journal.append(capture, make_snapshot(capture), b"state")
    discrepancy(None, tmp_path / "out", journal=tmp_path / "j")
    outcome = json.loads((tmp_path / "out" / "result.json").read_text())
    assert outcome["verdict"] == "no_gap"
    assert read_model(tmp_path / "out" / "model.extended.yaml").name == model.name


@pytest.mark.parametrize("both", [True, False])
def test_a_campaign_and_a_journal_exclude_each_other(tmp_path: Path, both: bool) -> None:
    given = tmp_path if both else None
    with pytest.raises(CampaignError, match="either a campaign directory or --journal"):
        discrepancy(given, tmp_path / "out", journal=given)


@pytest.mark.parametrize(
    "besides", [["--journal", "j"], ["--cell", "c.yaml"], ["--scheduler", "tcp://x"], ["--effects", "e.py"]]
)
def test_what_does_not_go_with_a_base_model_is_refused(tmp_path: Path, besides: list[str]) -> None:
    given = ["discrepancy", str(tmp_path), "--base", "base.yaml", "-o", str(tmp_path / "out"), *besides]
    refused = CliRunner().invoke(app, given).exception
    assert isinstance(refused, CampaignError)
    assert str(refused) == "--base goes with a campaign, --train, --test, --seed and --title alone"


@pytest.mark.parametrize("besides", [[], ["--base", "base.yaml"]])
def test_a_seed_below_nought_is_refused_before_anything_is_done(tmp_path: Path, besides: list[str]) -> None:
    given = ["discrepancy", str(tmp_path), "-o", str(tmp_path / "out"), "--seed", "-1", *besides]
    ran = CliRunner().invoke(app, given)
    assert ran.exit_code == 2
    assert "seed" in ran.output
    with pytest.raises(CampaignError, match="seed is -1: a seed is a whole number of at least 0"):
        impactcell.discrepancy(tmp_path, seed=-1, base="base.yaml" if besides else None)


def test_an_empty_journal_is_said_by_name(tmp_path: Path) -> None:
    with Journal(tmp_path / "j", "press-1"):
        pass
    with pytest.raises(CampaignError, match="j: no capture with samples"):
        discrepancy(None, tmp_path / "out", journal=tmp_path / "j")
    assert not (tmp_path / "out").exists()


def test_without_a_stroke_the_actuator_halts_as_it_loses_contact() -> None:
    """As the campaign format has it: one that goes on catches up with the part, and pushes it again."""
    rng = np.random.default_rng(2)
    settings = itertools.product(range(2), (3500, 5500), (18.9, 25.2), (1, -1))
    taps = [
        Tap(velocity / 6e4, 0.2 * math.exp(0.01 * rng.normal()), mass_kg=mass, direction=sign, effects={})
        for _, velocity, mass, sign in settings
    ]
    shots = tuple(tap.capture(rng, cycle=number) for number, tap in enumerate(taps, 1))
    sensors = {"force": Sensor(1e4, 0.4), "position": Sensor(1e4, 1.5e-6)}
    found = investigate(Campaign(Excitation.TAP, shots, sensors=sensors))
    assert found.verdict == "no_gap"


@pytest.mark.parametrize(("share", "doubted"), [(1.0, 0), (0.5, 1)])
def test_noise_that_is_stated_too_small_is_doubted(share: float, doubted: int) -> None:
    """Samples that scatter by more than what is stated of them make a gap of any model."""
    given = make(shots=12)
    force = replace(given.sensors["force"], noise_std=share * given.sensors["force"].noise_std)
    shots = tuple(
        replace(shot, force=shot.force and replace(shot.force, noise_std=force.noise_std))
        for shot in given.shots
    )
    notes = sensor_noise(
        prepare(replace(given, shots=shots, sensors={**given.sensors, "force": force}))
    ).notes
    assert sum("neighbouring samples scatter by" in note for note in notes) == doubted
    assert all("check noise_std_n of sensors: force in campaign.yaml" in note for note in notes)


@pytest.mark.slow
def test_unequal_rates_and_gaps_in_time_cost_nothing_but_are_said() -> None:
    given = make("viscous_friction", shots=18)

    def spoilt(shot: Capture) -> Capture:
        force, position = thinned(shot.force, 2), thinned(shot.position, 3, 1)
        assert position is not None
        lost = (position.time_s > 0.02) & (position.time_s < 0.035)
        position = replace(position, time_s=position.time_s[~lost], values=position.values[~lost])
        return replace(shot, force=force, position=position)

    found = investigate(changed(given, spoilt))
    assert found.added == ("viscous_friction",)
    assert found.validation.held_out.after.trace == pytest.approx(1.0, abs=0.06)
    assert any("has a gap in time" in note for note in result_document(found)["notes"])


def test_a_shot_without_force_among_others_is_used_all_the_same() -> None:
    given = make(shots=24)
    part = changed(given, lambda shot: replace(shot, force=None) if shot.cycle % 3 == 0 else shot)
    found = investigate(part)
    assert found.verdict == "no_gap"
    scatter = 1.0 / math.sqrt(2.0 * found.held_problem.shots.values.size)
    assert found.validation.held_out.before.trace == pytest.approx(1.0, abs=4.0 * scatter)


def test_without_positions_the_loss_of_power_is_said() -> None:
    given = changed(make(shots=12), lambda shot: replace(shot, position=None))
    assert any("No position channel" in note for note in prepare(given).notes)


def test_samples_that_are_no_numbers_are_named_by_file_and_line(tmp_path: Path) -> None:
    campaigns.write(make(shots=12), tmp_path / "campaign")
    trace = tmp_path / "campaign" / "traces" / "3.csv"
    lines = trace.read_text().splitlines()
    cells = lines[40].split(",")
    lines[40] = ",".join([cells[0], "nan", *cells[2:]])
    trace.write_text("\n".join(lines) + "\n")
    with pytest.raises(CampaignError, match=r"traces/3\.csv:41: .*'nan' is not a finite number"):
        discrepancy(tmp_path / "campaign", tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("change", "message"), [("velocity_m_s", "velocity"), ("mass_kg", "mass")])
def test_settings_wrong_by_a_thousand_are_noticed(change: str, message: str) -> None:
    given = make(shots=12)
    wrong = changed(given, lambda shot: replace(shot, **{change: getattr(shot, change) * 1000.0}))
    with pytest.raises(CampaignError, match=message):
        investigate(wrong)


def test_a_missing_trace_is_named(tmp_path: Path) -> None:
    campaigns.write(make(shots=12), tmp_path / "campaign")
    (tmp_path / "campaign" / "traces" / "5.csv").unlink()
    with pytest.raises(CampaignError, match=r"5\.csv"):
        discrepancy(tmp_path / "campaign", tmp_path / "out")


def test_what_an_earlier_run_has_left_stays_when_this_one_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaigns.write(make(shots=12), tmp_path / "campaign")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "result.json").write_text("of before")

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("impactcell.api.findings.write_extended_model", interrupt)
    with pytest.raises(KeyboardInterrupt):
        discrepancy(tmp_path / "campaign", tmp_path / "out")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["result.json"]
    assert (tmp_path / "out" / "result.json").read_text() == "of before"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["campaign", "out"]


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_progress_is_shown_on_a_terminal_only(monkeypatch: pytest.MonkeyPatch) -> None:
    for stream, shown in ((Terminal(), True), (io.StringIO(), False)):
        monkeypatch.setattr("sys.stderr", stream)
        with named_steps() as say:
            say("naming effects")
        assert ("naming effects" in stream.getvalue()) is shown


def test_every_step_is_announced() -> None:
    said: list[str] = []
    investigate(make(shots=12), progress=said.append)
    assert [one.split()[0] for one in said] == ["fitting", "locating", "proving", "planning"]


def test_one_batch_one_mass_one_direction_are_said_as_a_loss_of_power() -> None:
    given = make(shots=60)
    first = given.shots[0]
    kept = [
        shot for shot in given.shots if (shot.mass_kg, shot.direction) == (first.mass_kg, first.direction)
    ]
    notes = " ".join(prepare(replace(given, shots=tuple(kept))).notes)
    assert "One direction only" in notes
    assert "One mass only" in notes
    assert np.unique([shot.velocity_m_s for shot in kept]).size > 1
    assert "One velocity only" not in notes
