"""A model that the cell's own last taps speak against is not put into service unasked."""

import errno
import json
import math
import os
import re
import shlex
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from impactcell.cli.accept_model import previous_model
from impactcell.cli.app import run_verb
from impactcell.cli.own_taps import TAPS, OwnTaps, compare_on_own_taps
from impactcell.errors import ForeignJournalError, PredictionError, SettingsError
from impactcell.journal.store import Journal
from impactcell.physics.effects import LIBRARY, withdraw_effect
from impactcell.physics.outside_effects import offer_effects
from impactcell.prediction import Model
from impactcell.settings import read_cell
from impactcell.settings.model_file import read_model, write_model
from tests import own_cell
from tests.integration.processes import CONFIG
from tests.snapshots import make_snapshot
from tests.taps import Tap

pytestmark = pytest.mark.slow

CELL = own_cell.CELL + "journal: {{file: own.sqlite}}\n"


def oily(model: Model) -> Model:
    """The same plant in thick oil, of which the cell knows nothing."""
    effects = {"viscous_friction": {"viscous_coefficient_n_s_per_m": 300.0}}
    intervals = {"viscous_friction": {"viscous_coefficient_n_s_per_m": (280.0, 325.0)}}
    return replace(model, plant=replace(model.plant, effects=effects), name="in oil", intervals=intervals)


@pytest.fixture
def taps() -> int:
    """How many are looked at: fewer than a user's, for the sake of time."""
    return 12


@pytest.fixture
def cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, taps: int) -> Path:
    """Cell whose journal holds more taps than are looked at, the first of them of another plant."""
    monkeypatch.setattr("impactcell.cli.accept_model.calibrated_model", lambda config: config.model)
    monkeypatch.setattr("impactcell.cli.own_taps.TAPS", taps)
    model = read_cell(CONFIG / "cells" / "prototype.yaml").model
    write_model(model, tmp_path / "model.yaml")
    (tmp_path / "cell.yaml").write_text(CELL.format(maps=CONFIG / "maps"))
    with Journal(tmp_path / "own.sqlite", "own") as journal:
        for cycle in range(1, taps + 4):
            draw = np.random.default_rng([cycle, 3])
            mu_s = 0.2 if cycle > 3 else 0.4
            tap = Tap(0.06, mu_s * (1.0 + 0.01 * draw.standard_normal()), stroke_m=1.5e-3)
            journal.append(
                replace(tap.capture(draw, cycle=cycle), session=1),
                make_snapshot(tap.capture(draw, cycle=cycle)),
                b"",
                (),
            )
    return tmp_path / "cell.yaml"


@pytest.mark.parametrize("taps", [TAPS])
def test_the_last_taps_of_the_journal_are_asked(cell: Path, taps: int) -> None:
    config = read_cell(cell)
    own = compare_on_own_taps(config, oily(config.model))
    assert own is not None
    assert own.taps == taps == 30
    assert own.gap_before == pytest.approx(1.0, abs=0.15)
    assert own.gap_after > 2.0
    assert own.usable_before == taps
    assert own.speaks_against
    same = compare_on_own_taps(config, config.model)
    assert same is not None
    assert same.gap_after == same.gap_before
    assert not same.speaks_against


def test_a_model_of_another_plant_is_put_into_service_only_if_that_is_meant(
    cell: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other, before = cell.parent / "other.yaml", read_cell(cell).model
    write_model(oily(before), other)
    with pytest.raises(PredictionError, match="of the cell's last 12 taps it leaves") as refused:
        run_verb(["model", "accept", str(cell), str(other)])
    assert read_cell(cell).model == before
    told_command = re.search(r"is not put into service \(`impactcell (.*)` would\): of", str(refused.value))
    assert told_command is not None
    with pytest.raises(SystemExit) as ended:
        run_verb([*shlex.split(told_command[1]), "--json"])
    assert ended.value.code == 0
    told = json.loads(capsys.readouterr().out)["own_taps"]
    assert told["taps"] == 12
    assert told["gap_after"] > 1.5 * told["gap_before"]
    assert read_cell(cell).model.name == "in oil"
    with pytest.raises(SystemExit):
        run_verb(["model", "accept", str(cell), str(other)])
    assert "runs with model in oil already; nothing was changed" in capsys.readouterr().out
    assert read_model(previous_model(read_cell(cell).settings.model)) == before, "no way back is left"


def test_a_dry_run_refuses_what_would_be_refused_and_tells_what_would_change(
    cell: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other, before = cell.parent / "other.yaml", read_cell(cell).model
    write_model(oily(before), other)
    with pytest.raises(PredictionError) as refused:
        run_verb(["model", "accept", str(cell), str(other)])
    capsys.readouterr()
    with pytest.raises(PredictionError) as foretold:
        run_verb(["model", "accept", str(cell), str(other), "--dry-run", "--json"])
    assert str(foretold.value) == str(refused.value)
    told = json.loads(capsys.readouterr().out)
    assert told["refused"] == str(refused.value)
    assert [(change["after"], change["ci95"]) for change in told["changes"]] == [(300.0, [280.0, 325.0])]
    with pytest.raises(SystemExit) as ended:
        run_verb(["model", "accept", str(cell), str(other), "--dry-run", "--anyway", "--json"])
    assert ended.value.code == 0
    told = json.loads(capsys.readouterr().out)
    assert told["refused"] is None
    assert told["own_taps"]["gap_after"] > 1.5 * told["own_taps"]["gap_before"]
    assert read_cell(cell).model == before
    assert not previous_model(read_cell(cell).settings.model).exists()


def test_whose_model_changes_too_is_told(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Four shipped cells name one model file: what one of them accepted changed all, without a word."""
    other, before = cell.parent / "other.yaml", read_cell(cell).model
    write_model(replace(before, name="the same again"), other)
    twin = cell.parent / "twin.yaml"
    twin.write_text(cell.read_text().replace("cell: own", "cell: twin"))
    (cell.parent / "third.yaml").write_text(
        cell.read_text().replace("cell: own", "cell: third").replace("model.yaml", "other.yaml")
    )
    for command in (["accept", str(cell), str(other)], ["restore", str(cell)]):
        with pytest.raises(SystemExit) as ended:
            run_verb(["model", *command])
        assert ended.value.code == 0
        said = capsys.readouterr().err
        assert "model.yaml is the model file of twin too: " in said
        assert "third" not in said
    with pytest.raises(SystemExit):
        run_verb(["model", "accept", str(cell), str(other), "--dry-run", "--json"])
    assert json.loads(capsys.readouterr().out)["shared_with"] == ["twin"]
    twin.unlink()
    assert before.provenance["calibrated by"].endswith(", cell prototype"), (
        "a copy of a cell's that is not here"
    )
    with pytest.raises(SystemExit):
        run_verb(["model", "accept", str(cell), str(other)])
    assert "model file of" not in capsys.readouterr().err


@pytest.mark.parametrize("verb", [["fit"], ["accept", "other.yaml"], ["accept", "other.yaml", "--dry-run"]])
def test_taps_of_another_cell_give_and_judge_no_model(cell: Path, verb: list[str]) -> None:
    """A cell file that was copied for a second cell, with the first one's journal still in it."""
    write_model(oily(read_cell(cell).model), cell.parent / "other.yaml")
    cell.write_text(cell.read_text().replace("cell: own", "cell: second"))
    before = files(cell.parent)
    command, *others = verb
    with pytest.raises(ForeignJournalError, match="the journal of cell 'own', not of 'second'; name another"):
        run_verb(["model", command, str(cell), *(str(cell.parent / one) for one in others[:1]), *others[1:]])
    assert files(cell.parent) == before


def test_an_effect_file_that_a_model_needs_is_told(cell: Path, capsys: pytest.CaptureFixture[str]) -> None:
    effect = CONFIG / "effects" / "position_force.py"
    offer_effects([effect])
    try:
        before = read_cell(cell).model
        typical = {one.name: one.typical for one in LIBRARY["position_force"].parameters}
        plant = replace(before.plant, effects={"position_force": typical})
        write_model(replace(before, plant=plant), cell.parent / "other.yaml")
        with pytest.raises(SystemExit):
            run_verb(["model", "accept", str(cell), str(cell.parent / "other.yaml"), "--anyway"])
        assert f"needs {effect.resolve()}: keep that file there" in capsys.readouterr().err
    finally:
        withdraw_effect("position_force")


def test_a_dry_run_sees_that_the_model_before_could_not_be_kept(cell: Path) -> None:
    other = cell.parent / "other.yaml"
    write_model(read_cell(cell).model, other)
    previous_model(read_cell(cell).settings.model).mkdir()
    said = []
    for dry in ([], ["--dry-run"]):
        with pytest.raises(SettingsError, match=r"model\.previous\.yaml: is a directory") as refused:
            run_verb(["model", "accept", str(cell), str(other), *dry])
        said.append(str(refused.value))
    assert said[0] == said[1]


@pytest.fixture
def accepted(cell: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """Cell without taps of its own in which a model was accepted; somebody has written in its file since."""
    (cell.parent / "own.sqlite").unlink()
    other = cell.parent / "other.yaml"
    write_model(oily(read_cell(cell).model), other)
    with pytest.raises(SystemExit):
        run_verb(["model", "accept", str(cell), str(other)])
    target = cell.parent / "model.yaml"
    target.write_bytes(b"# ours: \xc3\xb6l\r\n" + target.read_bytes())
    other.unlink()
    return cell


def files(directory: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in directory.glob("model*")}


def bar(monkeypatch: pytest.MonkeyPatch, barred: str) -> None:
    """Let nobody write what begins with a name: not in its place, and not beside it."""
    make, write = tempfile.mkstemp, Path.write_bytes
    refused = PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    def mkstemp(*, dir: Path, prefix: str) -> tuple[int, str]:  # noqa: A002 - as it is called
        if prefix.startswith(f".{barred}"):
            raise refused
        return make(dir=dir, prefix=prefix)

    def write_bytes(path: Path, data: bytes) -> int:
        if path.name.startswith(barred):
            raise refused
        return write(path, data)

    monkeypatch.setattr(tempfile, "mkstemp", mkstemp)
    monkeypatch.setattr(Path, "write_bytes", write_bytes)


def test_the_model_before_comes_back_and_the_one_in_service_takes_its_place(
    accepted: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = files(accepted.parent)
    capsys.readouterr()
    with pytest.raises(SystemExit):
        run_verb(["model", "restore", str(accepted)])
    said = capsys.readouterr().out
    assert (
        "own runs with model prototype from the next cycle on, as before\nk 650000 ± 13000 N/m, b 465 ± 18.6 "
        "N s/m, mu_k/mu_s 0.7600 ± 0.046 (± is 95 %); plant: the paper's prototype as reconstructed; "
    ) in said
    assert said.endswith(f"`impactcell model restore {accepted}` again undoes it\n")
    assert read_cell(accepted).model == read_cell(CONFIG / "cells" / "prototype.yaml").model
    after = files(accepted.parent)
    assert sorted(after) == ["model.previous.yaml", "model.yaml"]
    assert after["model.previous.yaml"] == before["model.yaml"], "to the byte"


@pytest.mark.parametrize("verb", ["accept", "restore"])
@pytest.mark.parametrize("barred", ["model.previous.yaml", "model.yaml"])
def test_no_model_is_lost_where_one_cannot_be_written(
    accepted: Path, monkeypatch: pytest.MonkeyPatch, barred: str, verb: str
) -> None:
    before, other = files(accepted.parent), accepted.parent / "third.yaml"
    write_model(replace(read_cell(accepted).model, name="third"), other)
    bar(monkeypatch, barred)
    said = f"{accepted.parent / barred}: cannot be written: Permission denied"
    with pytest.raises(SettingsError, match=re.escape(said)) as told:
        run_verb(["model", verb, str(accepted), *([str(other)] if verb == "accept" else [])])
    assert files(accepted.parent) == before
    way_out = f"nothing was changed: let who runs this write in {accepted.parent}, and do it again"
    assert (way_out in str(told.value)) is (barred == "model.previous.yaml")


def test_where_the_model_before_cannot_be_moved_it_is_told_where_it_lies(
    accepted: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_service, move = (accepted.parent / "model.yaml").read_bytes(), Path.replace

    def refused(path: Path, target: Path) -> Path:
        if target.name == "model.previous.yaml":
            raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))
        return move(path, target)

    monkeypatch.setattr(Path, "replace", refused)
    beside = accepted.parent / "model.previous.yaml.new"
    with pytest.raises(
        SettingsError, match=re.escape(f"the model before it lies in {beside}: move it there")
    ):
        run_verb(["model", "restore", str(accepted)])
    assert beside.read_bytes() == in_service
    assert read_cell(accepted).model.name == "prototype"


def test_a_cell_without_taps_of_its_own_takes_any_model(
    cell: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (cell.parent / "own.sqlite").unlink()
    other = cell.parent / "other.yaml"
    write_model(oily(read_cell(cell).model), other)
    with pytest.raises(SystemExit) as ended:
        run_verb(["model", "accept", str(cell), str(other), "--json"])
    assert ended.value.code == 0
    assert json.loads(capsys.readouterr().out)["own_taps"] is None


@pytest.mark.parametrize(
    ("after", "usable", "against"),
    [(1.4, 30, False), (1.6, 30, True), (1.0, 14, True), (1.0, 15, False), (math.nan, 30, True)],
)
def test_what_speaks_against_a_model(after: float, usable: int, *, against: bool) -> None:
    own = OwnTaps(30, 1.0, after, 30, usable)
    assert own.speaks_against is against
    assert (own.content["gap_after"] is None) is math.isnan(after)
    assert ("can follow none" in own.sentence) is math.isnan(after)


def test_where_neither_model_follows_a_tap_the_new_one_is_not_to_blame() -> None:
    assert not OwnTaps(5, math.nan, math.nan, 0, 0).speaks_against
    assert not OwnTaps(5, 7.0, 8.0, 5, 5).speaks_against
