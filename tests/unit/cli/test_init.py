"""An own cell from nothing: init, check, the model of its first taps; cells that do not fit together."""

import contextlib
import json
import math
import re
import shlex
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from impactcell.api.first_model import FirstModel
from impactcell.campaign import Campaign, read
from impactcell.cell import in_place_of
from impactcell.cli.accept_model import put_into_service
from impactcell.cli.app import run_verb
from impactcell.errors import CampaignError, ImpactCellError, PredictionError, SettingsError
from impactcell.journal.store import Journal
from impactcell.physics import Plant, TapInput
from impactcell.prediction import calibration
from impactcell.prediction.joint_plant_fit import PlantFit
from impactcell.process.shipped import shipped_config
from impactcell.settings import read_cell
from impactcell.settings.model_file import read_model
from simulator.campaign_files import write
from simulator.campaign_scenario import CampaignScenario
from tests.snapshots import make_snapshot

PLANT = {"stiffness_n_per_m": 3e5, "damping_n_s_per_m": 210, "mu_s": 0.31, "ratio": 0.8}
ANSWERS = ["--name", "own", "--mass-kg", "4.2", "--stroke-mm", "2", "--wear-limit", "0.4", "--port", "5020"]


def run(*arguments: object) -> None:
    with pytest.raises(SystemExit) as ended:
        run_verb([str(argument) for argument in arguments])
    assert ended.value.code == 0


@pytest.fixture(scope="module")
def shots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Thirty taps on another plant, with another mass and stroke, written by the simulator."""
    scenario = {
        "format": 1, "excitation": "tap", "seed": 3, "plant": PLANT, "masses_kg": [4.2], "stroke_m": 0.002,
        "velocities_mm_per_min": [2000, 3000, 4500, 6000], "replicates": 5,
        "sensors": {
            "force": {"rate_hz": 20000, "noise_std": 0.4},
            "position": {"rate_hz": 20000, "noise_std": 1.5e-6},
        },
    }  # fmt: skip
    directory = tmp_path_factory.mktemp("taps") / "shots"
    write(CampaignScenario.model_validate(scenario), directory)
    return directory


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cell begun with nothing measured."""
    directory = tmp_path_factory.mktemp("own")
    run("init", directory, *ANSWERS)
    return directory


@pytest.mark.parametrize("name", ["press 1", "a/b", "../press", "", "Preß"])
def test_a_name_that_is_none_is_refused_and_nothing_is_written(tmp_path: Path, name: str) -> None:
    with pytest.raises(
        SettingsError, match=r"up to 64 letters \(a to z\), digits, '_', '-' or '\.', as in press-1"
    ):
        run_verb(["init", str(tmp_path / "own"), *ANSWERS, "--name", name])
    assert not (tmp_path / "own").exists()


@pytest.mark.parametrize(("option", "value"), [("--mass-kg", "-4.2"), ("--wear-limit", "0")])
def test_an_answer_that_is_not_above_0_is_named_and_nothing_is_written(
    tmp_path: Path, option: str, value: str
) -> None:
    """The register map was left in the directory."""
    with pytest.raises(SettingsError, match=rf"{option} {value}: has to be above 0"):
        run_verb(["init", str(tmp_path / "own"), *ANSWERS, option, value])
    assert not (tmp_path / "own").exists()


def test_a_part_that_does_not_slide_for_an_answer_in_another_unit_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A wear limit of 25 for 25 % made the way out a tap of 28000 mm/min."""

    def refuse(_: object) -> None:
        raise PredictionError("no part slides free")

    monkeypatch.setattr("impactcell.cli.init.calibrated_model", refuse)
    told = r"no part slides free; --wear-limit: a friction .* of 25 .*: if that was meant in %, write 0.25$"
    with pytest.raises(PredictionError, match=told):
        run_verb(["init", str(tmp_path / "own"), *ANSWERS, "--wear-limit", "25"])
    with pytest.raises(PredictionError, match=r"no part slides free$"):
        run_verb(["init", str(tmp_path / "cells" / "own"), *ANSWERS])
    assert list(tmp_path.iterdir()) == [], "nor the directories that were made for it"


def test_a_map_with_a_fault_is_told_by_its_own_name_and_nothing_is_written(tmp_path: Path) -> None:
    """What was told was the copy, which is removed again; the empty directory stayed."""
    own = tmp_path / "own-map.yaml"
    shipped = shipped_config() / "maps" / "fpga-v1.yaml"
    own.write_text(shipped.read_text().replace("type: u16, expect: 1", "type: u17, expect: 1"))
    with pytest.raises(SettingsError, match=rf"^{re.escape(str(own))}:\d+:\d+: register \w+: type must be"):
        run_verb(["init", str(tmp_path / "cell"), *ANSWERS, "--map", str(own)])
    assert [path.name for path in tmp_path.iterdir()] == ["own-map.yaml"]


@pytest.mark.slow
def test_a_cell_from_nothing_can_be_read_and_says_what_to_do(
    begun: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = read_cell(begun / "own.yaml")
    assert cell.model.name == "own-provisional"
    assert cell.model.stroke_m == pytest.approx(2e-3)
    assert cell.model.predictors[0].mass_kg < 4.2 < cell.model.predictors[-1].mass_kg
    run("check", begun / "own.yaml", "--json")
    said = json.loads(capsys.readouterr().out)
    assert said["faults"] == []
    assert [note["message"].partition(" is")[0] for note in said["notes"]] == [
        "how noisy the force sensor",
        "how noisy the position sensor",
        "there",
    ]
    assert "0.4 N is taken, a guess; say `force_noise_std_n` under `sensors`" in said["notes"][0]["message"]
    with pytest.raises(SettingsError, match="is there already"):
        run_verb(["init", str(begun), *ANSWERS])


@pytest.mark.slow
def test_a_map_may_be_called_like_the_cell(
    begun: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    model = read_cell(begun / "own.yaml").model
    monkeypatch.setattr("impactcell.cli.init.calibrated_model", lambda _: model)
    own = tmp_path / "own.yaml"
    shutil.copyfile(begun / "fpga-v1.yaml", own)
    run("init", tmp_path / "cell", *ANSWERS, "--map", own)
    assert (tmp_path / "cell" / "own.map.yaml").read_bytes() == own.read_bytes()
    assert read_cell(tmp_path / "cell" / "own.yaml").register_map.name == "fpga-v1"
    assert "users.yaml NAME --role engineer" in capsys.readouterr().out, "the next steps run as they stand"


@pytest.mark.slow
def test_a_model_that_does_not_fit_the_cell_is_told_when_it_is_accepted(
    begun: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(begun, tmp_path / "own")
    theirs = shipped_config() / "models" / "prototype.yaml"  # of 18.9 kg
    monkeypatch.setattr("impactcell.cli.accept_model.calibrated_model", lambda config: config.model)
    run("model", "accept", tmp_path / "own" / "own.yaml", theirs)
    assert "the part has 4.2 kg, model 'prototype' is calibrated for" in capsys.readouterr().err


def test_a_stroke_that_catches_up_with_the_part_is_told_with_the_way_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(calibration, "regimes", lambda *_: None)
    monkeypatch.setattr(calibration, "velocity_spans", lambda *_: ())
    tap = TapInput(velocity_m_s=0.1, mass_kg=12.0, stroke_m=0.25)
    speeds, frictions = np.linspace(0.03, 0.1, 3), np.linspace(0.2, 0.3, 3)
    told = "from about 44000 mm/min on, or with a stroke of less than about 4.7 mm"  # v² = mu_k g s
    with pytest.raises(PredictionError, match=told):
        calibration.calibrate(Plant(4e5, 300.0, 0.28, 0.2166), tap, [12.0], speeds, frictions)


@pytest.mark.slow
def test_further_taps_are_taken_where_the_first_are_not_good_enough(
    begun: Path, shots: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from impactcell.cli import first_model

    shutil.copytree(begun, tmp_path / "own")
    captures = read(shots).shots[:9]
    with Journal(tmp_path / "own" / "own.sqlite", "own") as journal:
        for capture in captures:
            journal.append(capture, make_snapshot(capture), b"", ())
    model, counts = read_cell(begun / "own.yaml").model, []

    def fit(campaign: Campaign, *_: str) -> FirstModel:
        counts.append(len(campaign.shots))
        return FirstModel(PlantFit(model, (), 1.0), len(campaign.shots), ("strike more taps",))

    monkeypatch.setattr(first_model, "fit_first_model", fit)
    monkeypatch.setattr(first_model, "TAPS", 3)
    cell = str(tmp_path / "own" / "own.yaml")
    for taps in ([], ["--taps", "4"]):
        with pytest.raises(PredictionError, match="not put into service"):
            run_verb(["model", "fit", cell, *taps])
    assert counts == [3, 6, 9, 4], "twice as many while there are more; as many as said"


def test_what_has_to_be_said_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin.isatty", lambda: False, raising=False)
    with pytest.raises(SettingsError, match="--mass-kg, --stroke-mm, --wear-limit"):
        run_verb(["init", str(tmp_path)])
    for option, value in (("--map", "none"), ("--mass-kg", "nan"), ("--wear-limit", "-1"), ("--name", "a b")):
        with pytest.raises(ImpactCellError):
            run_verb(["init", str(tmp_path / "d"), *ANSWERS, option, value])
    assert not list(tmp_path.rglob("*.yaml")) or not (tmp_path / "d" / "own.yaml").exists()


@pytest.mark.slow
def test_a_map_that_says_otherwise_is_named_and_another_map_is_not_taken_for_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A constant of the map counts more than the cell file; a map of an earlier try is not used silently."""
    theirs = (shipped_config() / "maps" / "one-buffer.yaml").read_text()
    own = tmp_path / "own-map.yaml"
    answers = [str(tmp_path / "cell"), *ANSWERS, "--map", str(own)]
    own.write_text(theirs.replace("address: 12,", "address: 70000,"))
    with pytest.raises(SettingsError, match="70000"):
        run_verb(["init", *answers])
    assert not (tmp_path / "cell").exists(), "nothing is left of what was not begun"
    own.write_text(theirs)
    run("init", *answers)
    with pytest.raises(
        SettingsError, match=r"the mass is 4\.2 kg here and always 18\.9 kg in the register map"
    ):
        run_verb(["check", str(tmp_path / "cell" / "own.yaml")])
    (tmp_path / "cell" / "own.yaml").rename(tmp_path / "cell" / "other.yaml")
    (tmp_path / "cell" / "own.model.yaml").unlink()
    own.write_text(theirs.replace("value: 18.9", "value: 4.2"))
    with pytest.raises(SettingsError, match="is another map than"):
        run_verb(["init", *answers])


@pytest.mark.slow
def test_the_first_model_is_that_of_the_plant(
    shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run("init", tmp_path, *ANSWERS, "--campaign", shots)
    model = read_cell(tmp_path / "own.yaml").model
    plant = model.plant
    assert plant.stiffness_n_per_m == pytest.approx(PLANT["stiffness_n_per_m"], rel=0.01)
    assert plant.damping_n_s_per_m == pytest.approx(PLANT["damping_n_s_per_m"], rel=0.05)
    assert plant.mu_k / plant.mu_s == pytest.approx(
        PLANT["ratio"], abs=min(0.05, 2.5 * model.prior.ratio_std)
    )
    assert "good enough to estimate friction with" in capsys.readouterr().out


def test_a_host_that_is_more_than_an_address_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"--host '10\.0\.0\.5:503': .* and `port: 503`"):
        run_verb(["init", str(tmp_path / "d"), *ANSWERS, "--host", "10.0.0.5:503"])
    assert not (tmp_path / "d").exists()


@pytest.mark.slow
@pytest.mark.parametrize("campaign", [False, True])
def test_the_noise_of_the_sensors_is_what_was_said_or_what_the_taps_show(
    begun: Path, shots: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, campaign: bool
) -> None:
    model, taps = read_cell(begun / "own.yaml").model, read(shots)
    silent = [replace(s, force=replace(s.force, noise_std=None)) for s in taps.shots[:3] if s.force]
    monkeypatch.setattr("impactcell.cli.init.calibrated_model", lambda _: model)
    monkeypatch.setattr("impactcell.cli.init.read", lambda _: replace(taps, shots=tuple(silent)))
    first = FirstModel(PlantFit(model, (), 1.0), 3, ())
    monkeypatch.setattr("impactcell.cli.init.fit_first_model", lambda *_: first)
    recorded = ["--campaign", shots] if campaign else []
    run("init", tmp_path, *ANSWERS, "--position-noise-um", "2.5", *recorded)
    sensors = yaml.safe_load((tmp_path / "own.yaml").read_text())["sensors"]
    assert sensors.pop("position_noise_std_um") == 2.5
    assert sensors == ({"force_noise_std_n": pytest.approx(0.4, rel=0.1)} if campaign else {})
    for wrong in ("nan", "-1"):
        with pytest.raises(SettingsError, match="noise of a sensor has to be above 0"):
            run_verb(["init", str(tmp_path / "d"), *ANSWERS, "--force-noise-n", wrong])


@pytest.mark.slow
def test_more_noise_in_the_taps_than_was_said_is_told(
    begun: Path, shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(begun, tmp_path / "own")
    cell = tmp_path / "own" / "own.yaml"
    with Journal(tmp_path / "own" / "own.sqlite", "own") as journal:
        for shot in read(shots).shots[:4]:
            captured = replace(shot, force=replace(shot.force, noise_std=None), position=None)
            journal.append(captured, make_snapshot(captured), b"", ())
    written = cell.read_text()
    for said, told in (
        (0.1, "a noise of 0.1 N is too little: the first taps of its journal show 0.4"),
        (0.4, ""),
    ):
        cell.write_text(f"{written}sensors: {{force_noise_std_n: {said}, position_noise_std_um: 1.5}}\n")
        run("check", cell, "--json")
        notes = [note["message"] for note in json.loads(capsys.readouterr().out)["notes"]]
        assert [told in note for note in notes if note.startswith("a noise")] == [True] * bool(told)
    cell.write_text(f"{written}sensors: {{position_noise_std_um: 1.5}}\n")
    run("check", cell)
    assert "0.4 N is taken, a guess; the first taps of its journal show 0.4" in capsys.readouterr().err


@pytest.mark.slow
def test_a_model_that_takes_the_place_of_a_provisional_one_says_so_until_another_does(
    begun: Path, tmp_path: Path
) -> None:
    """By that the service knows that what it has learned by a guess is to be learned anew."""
    shutil.copytree(begun, tmp_path / "own")
    cell = tmp_path / "own" / "own.yaml"
    guessed, fitted = read_cell(cell).model, read_cell(shipped_config() / "cells" / "prototype.yaml").model
    kept = put_into_service(read_cell(cell), fitted)
    assert read_model(kept).provenance == guessed.provenance
    marked = read_cell(cell).model
    assert marked == in_place_of(guessed, fitted)
    assert marked.provenance != fitted.provenance
    put_into_service(read_cell(cell), replace(fitted, name="again"))
    assert read_cell(cell).model.provenance == marked.provenance, "no cycle need have come by then"
    other = replace(fitted, provenance={"made by": "hand"})
    assert in_place_of(fitted, other) is other


@pytest.mark.slow
def test_the_first_taps_of_the_journal_make_the_model(
    begun: Path, shots: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(begun, tmp_path / "own")
    cell = tmp_path / "own" / "own.yaml"
    captures = [replace(shot, stroke_m=math.inf) for shot in read(shots).shots]  # the cell file knows it
    with Journal(tmp_path / "own" / "own.sqlite", "own"):
        pass
    with pytest.raises(CampaignError, match="no taps are in it yet"):
        run_verb(["model", "fit", str(cell)])
    with pytest.raises(CampaignError, match="--taps is of the journal"):
        run_verb(["model", "fit", str(cell), "--campaign", str(shots), "--taps", "5"])
    with Journal(tmp_path / "own" / "own.sqlite", "own") as journal:
        for capture in captures[:5]:
            journal.append(capture, make_snapshot(capture), b"", ())
    with pytest.raises(PredictionError, match="not put into service"):
        run_verb(["model", "fit", str(cell), "--json"])
    told = json.loads(capsys.readouterr().out)
    assert told["good_enough"] is False
    assert told["shortcomings"][0].startswith("only 5 taps could be used")
    assert read_cell(cell).model.name == "own-provisional"
    with Journal(tmp_path / "own" / "own.sqlite", "own") as journal:
        for capture in captures[5:]:
            journal.append(capture, make_snapshot(capture), b"", ())
    run("model", "fit", cell, "--json")
    out, told_beside = capsys.readouterr()
    told = json.loads(out)
    assert told["good_enough"] is True
    slow = sum(capture.velocity_m_s < 0.04 for capture in captures[:30])
    assert 0 < slow < 10, "in these the actuator meets the part again"
    assert (told["taps"], told["used"]) == (30, 30 - slow)
    assert abs(told["stiffness_n_per_m"]["value"] - 3e5) < 4 * told["stiffness_n_per_m"]["std"]
    assert read_cell(cell).model.name == "own"
    assert re.findall(r"yaml:\d+:\d+: note: (.*?) was not said", told_beside) == [
        "how noisy the force sensor is",
        "how noisy the position sensor is",
    ]
    assert "users file" not in told_beside, "which is nothing that taps show"
    run("model", "restore", cell)
    assert read_cell(cell).model.name == "own-provisional"
    assert "nothing of it was measured" in capsys.readouterr().err
    run("model", "restore", cell)
    assert f"fitted to {told['used']} taps of journal " in capsys.readouterr().out


def change(content: dict[str, Any], path: str, value: Any) -> None:
    *sections, key = path.split(".")
    for section in sections:
        content = content.setdefault(section, {})
    content[key] = value


@pytest.mark.parametrize(
    ("path", "value", "place", "said"),
    [
        ("part.mass_kg", 4200.0, "part", "4200 kg, model 'prototype' is calibrated for 9.45 to 37.8 kg"),
        (
            "actuator.stroke_mm",
            3.0,
            "actuator",
            "the stroke is 3 mm, model 'prototype' was calibrated for 1.5",
        ),
        ("actuator.max_velocity_mm_per_min", 900.0, "actuator", "taps are at most 900 mm/min"),
        (
            "sensors.force_noise_std_n",
            400.0,
            "sensors",
            "400 N cannot be: the fastest tap shows some 350 N; if that was meant in mN, write 0.4",
        ),
        (
            "sensors.position_noise_std_um",
            1500.0,
            "sensors",
            "1500 µm cannot be: the fastest tap shows some 3353 µm; if that was meant in nm, write 1.5",
        ),
        (
            "sensors.position_noise_std_um",
            1.5e-6,
            "sensors",
            "no sensor that follows a tap has less than 0.0001 µm; if that was meant in m, write 1.5",
        ),
        ("sensors.position_noise_std_um", 5e-5, "sensors", "meant in mm or m, write 0.05 or 50"),
        ("sensors.position_noise_std_um", 1e9, "sensors", "check its unit"),
        ("alarms.wear_limit", 0.2, "alarms", "the wear limit 0.2 is not above the friction of the model"),
        ("predictors", [], "model", "has no predictors"),
    ],
)
def test_a_cell_that_does_not_fit_together_is_refused(
    tmp_path: Path, path: str, value: Any, place: str, said: str
) -> None:
    content = yaml.safe_load((shipped_config() / "cells" / "prototype.yaml").read_text())
    model = yaml.safe_load((shipped_config() / "models" / "prototype.yaml").read_text())
    change(model if path == "predictors" else content, path, value)
    content["module"]["register_map"] = str(shipped_config() / "maps" / "fpga-v1.yaml")
    content["model"] = "model.yaml"
    (tmp_path / "model.yaml").write_text(yaml.safe_dump(model))
    cell = tmp_path / "cell.yaml"
    cell.write_text(yaml.safe_dump(content))
    with pytest.raises(SettingsError) as refused:
        run_verb(["check", str(cell)])
    fault = str(refused.value).splitlines()[0]
    assert said in fault
    line = int(fault.removeprefix(f"{cell}:").split(":")[0])
    section = next(
        text for text in reversed(cell.read_text().splitlines()[:line]) if not text.startswith(" ")
    )
    assert section.startswith(place)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("part.mass_kg", 4.2),
        ("actuator.stroke_mm", 2.0),
        ("alarms.wear_limit", 0.9),
        ("predictors", []),
    ],
)
def test_what_is_advised_can_be_typed_as_it_stands_and_helps(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    path: str,
    value: Any,
) -> None:
    for swept in ("VELOCITIES", "FRICTIONS", "MASSES"):
        monkeypatch.setattr(f"impactcell.cli.calibrate.{swept}", 5)
    config = tmp_path / "my cells"  # the model lies elsewhere, and its path has to be quoted
    shutil.copytree(shipped_config(), config)
    for file in ("cells/prototype.yaml", "models/prototype.yaml"):
        content = yaml.safe_load((config / file).read_text())
        if (path == "predictors") == file.startswith("models"):
            change(content, path, value)
        (config / file).write_text(yaml.safe_dump(content))
    monkeypatch.chdir(tmp_path)
    cell = "my cells/cells/prototype.yaml"

    def advice() -> list[str]:
        with contextlib.suppress(SettingsError, SystemExit):
            run_verb(["check", cell, "--json"])
        said = json.loads(capsys.readouterr().out)
        return re.findall("`(impactcell calibrate .*?)`", json.dumps(said["faults"] + said["notes"]))

    shared = (config / "models/prototype.yaml").read_bytes()
    [command] = advice()
    run(*shlex.split(command)[1:])
    capsys.readouterr()
    content = yaml.safe_load((config / "cells/prototype.yaml").read_text())
    change(content, "model", Path(shlex.split(command)[-1]).name)
    (config / "cells/prototype.yaml").write_text(yaml.safe_dump(content))
    assert advice() == []
    assert (config / "models/prototype.yaml").read_bytes() == shared, "other cells may run with it"


def test_faults_as_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "cell.yaml").write_text("format: 1\ncell: a\nnonsense: 1\n")
    with pytest.raises(SettingsError):
        run_verb(["check", str(tmp_path / "cell.yaml"), "--json"])
    faults = json.loads(capsys.readouterr().out)["faults"]
    assert {fault["line"] for fault in faults} >= {3}
    assert all(fault["file"] == str(tmp_path / "cell.yaml") for fault in faults)


@pytest.mark.slow
def test_friction_as_json(shots: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run("estimate", shots, "--json")
    rows = json.loads(capsys.readouterr().out)
    assert [row["shot"] for row in rows] == list(range(1, len(rows) + 1))
    assert sum(row["mu_s"] for row in rows) / len(rows) == pytest.approx(PLANT["mu_s"], abs=0.01)


def test_the_version(capsys: pytest.CaptureFixture[str]) -> None:
    from impactcell import __version__

    run("--version")
    assert capsys.readouterr().out == f"impactcell {__version__}\n"
