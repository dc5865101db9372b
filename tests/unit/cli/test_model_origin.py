"""`model accept` says what was established of a model, and refuses one whose contact nothing tells."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from impactcell.cli.app import run_verb
from impactcell.cli.model_origin import origin_of
from impactcell.errors import PredictionError
from impactcell.prediction import REMAINS, Model
from impactcell.settings import read_cell
from impactcell.settings.model_file import read_model, write_model
from tests.integration.processes import CONFIG
from tests.own_cell import CELL

GAPS = {"held-out gap before": "3.588", "held-out gap after": "1.02"}


@pytest.fixture
def cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Cell without taps of its own."""
    monkeypatch.setattr("impactcell.cli.accept_model.calibrated_model", lambda config: config.model)
    write_model(read_model(CONFIG / "models" / "prototype.yaml"), tmp_path / "model.yaml")
    (tmp_path / "cell.yaml").write_text(CELL.format(maps=CONFIG / "maps"))
    return tmp_path / "cell.yaml"


def found(cell: Path, provenance: Mapping[str, str]) -> Path:
    """Model file of an investigation that says so of itself."""
    model = read_cell(cell).model
    file = cell.parent / "found.yaml"
    write_model(replace(model, name="found", provenance={**model.provenance, **provenance}), file)
    return file


def accept(cell: Path, file: Path, *options: str) -> None:
    with pytest.raises(SystemExit) as ended:
        run_verb(["model", "accept", str(cell), str(file), *options])
    assert ended.value.code == 0


@pytest.mark.parametrize("dry_run", [(), ("--dry-run",)])
@pytest.mark.parametrize(
    ("provenance", "caution"),
    [
        ({"verdict": "no_gap"}, ""),
        ({"verdict": "named"}, ""),
        ({"verdict": "named", REMAINS: "12% of the held-out gap, in loading"}, "12% of the held-out gap, in"),
        ({"verdict": "unknown"}, "nothing was established: what is missing"),
        ({"verdict": "untested"}, "nothing was established: there were too few shots"),
    ],
)
def test_the_verdict_is_said_and_a_caution_where_it_is_due(
    cell: Path,
    capsys: pytest.CaptureFixture[str],
    provenance: Mapping[str, str],
    caution: str,
    dry_run: tuple[str, ...],
) -> None:
    file = found(cell, {**provenance, **GAPS})
    accept(cell, file, *dry_run)
    said = capsys.readouterr()
    assert f"verdict of the investigation it comes from: {provenance['verdict']} (" in said.out
    assert "held-out gap 3.588 noise floors before, 1.02 after" in said.out
    if caution:
        begin = "something remains" if REMAINS in provenance else caution
        assert said.err.startswith(f"caution: {begin}")
        assert caution in said.err
    else:
        assert said.err == ""
    accept(cell, file, "--json", *dry_run)
    told = json.loads(capsys.readouterr().out)
    assert told["verdict"] == provenance["verdict"]
    assert bool(told["caution"]) == bool(caution)


def test_of_a_model_of_no_investigation_nothing_is_said(
    cell: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert origin_of(read_cell(cell).model) is None
    accept(cell, found(cell, {}))
    said = capsys.readouterr()
    assert "verdict" not in said.out
    assert said.err == ""


def test_a_contact_that_nothing_tells_is_refused_with_its_width_and_the_way_out(
    cell: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A stiffness of "100 to 1e+11" went into service, and clean taps were 6 % off, marked good."""
    model = read_cell(cell).model
    prior = replace(model.prior, stiffness_std_n_per_m=2.5e10, damping_std_n_s_per_m=99870.0)
    file = found(cell, {"verdict": "unknown"})
    wide: Model = replace(read_model(file), prior=prior)
    write_model(wide, file)
    with pytest.raises(PredictionError, match=r"found is not put into service .*does not tell k ") as fault:
        run_verb(["model", "accept", str(cell), str(file)])
    assert " ± 5e+10 N/m, b " in str(fault.value)
    assert "mu_k/mu_s" not in str(fault.value)
    assert "record taps over more velocities" in str(fault.value)
    assert read_cell(cell).model == model
    with pytest.raises(PredictionError):
        run_verb(["model", "accept", str(cell), str(file), "--dry-run", "--json"])
    assert json.loads(capsys.readouterr().out)["refused"] == str(fault.value)
    accept(cell, file, "--anyway")
    assert read_cell(cell).model.prior == prior


def test_how_well_a_contact_is_told_stands_beside_what_changes_in_it(
    cell: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its stiffness alone stood there, as if it were known to all its digits."""
    file = found(cell, {})
    model = read_model(file)
    plant = replace(model.plant, stiffness_n_per_m=7e5, damping_n_s_per_m=300.0)
    prior = replace(model.prior, stiffness_std_n_per_m=1e4, damping_std_n_s_per_m=200.0)
    write_model(replace(model, plant=plant, prior=prior), file)
    accept(cell, file, "--dry-run", "--anyway", "--json")
    changes = {c["parameter"]: c["ci95"] for c in json.loads(capsys.readouterr().out)["changes"]}
    assert changes == {"stiffness_n_per_m": [6.8e5, 7.2e5], "damping_n_s_per_m": [0.0, 700.0]}
    accept(cell, file, "--dry-run", "--anyway")
    assert "\n  stiffness_n_per_m: 650000 -> 700000 (95 %: 680000 to 720000)\n" in capsys.readouterr().out
