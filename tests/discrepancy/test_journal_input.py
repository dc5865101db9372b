"""The discrepancy workflow on a journal: what its module does not report, and what is left out."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from impactcell import campaign as campaigns
from impactcell.cli.discrepancy import discrepancy
from impactcell.cli.export import export
from impactcell.errors import CampaignError
from impactcell.journal.store import Journal
from impactcell.records import Capture
from tests.discrepancy.study import write_blank_report
from tests.discrepancy.test_workflow import make
from tests.snapshots import make_capture, make_snapshot

CELL = Path("config/cells/prototype.yaml")


def recorded(path: Path, captures: tuple[Capture, ...]) -> Path:
    with Journal(path, "prototype") as journal:
        for capture in captures:
            journal.append(capture, make_snapshot(capture), b"state")
    return path


def silent(captures: tuple[Capture, ...]) -> tuple[Capture, ...]:
    """Captures as a module records them that reports neither mass nor stroke."""
    return tuple(replace(one, mass_kg=math.nan, stroke_m=math.inf) for one in captures)


def test_what_the_module_does_not_report_the_cell_states(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("impactcell.api.findings.write_reports", write_blank_report)
    taps = tuple(one for one in make("viscous_friction", shots=60).shots if one.mass_kg == 18.9)
    journal = recorded(tmp_path / "j", silent(taps))
    discrepancy(None, tmp_path / "out", journal=journal, cell=CELL)
    outcome = json.loads((tmp_path / "out" / "result.json").read_text())
    assert outcome["verdict"] == "no_gap"  # the cell's model has viscous friction
    assert not [note for note in outcome["notes"] if "mass" in note and "not stated" in note]
    assert "stroke_m: 0.0015" in (tmp_path / "out" / "model.extended.yaml").read_text()


def test_a_stroke_that_nobody_says_is_asked_for(tmp_path: Path) -> None:
    journal = recorded(tmp_path / "j", silent(make(shots=12).shots))
    with pytest.raises(CampaignError, match=r"/j: the module did not report its stroke, .* --cell CELL"):
        discrepancy(None, tmp_path / "out", journal=journal)
    assert not (tmp_path / "out").exists()


def test_what_is_left_out_of_a_journal_is_told_before_too_few_are_left(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    strokes = (1e-3, 1e-3, 2e-3, 3e-3, 4e-3)
    taps = [replace(make_capture(number), stroke_m=stroke) for number, stroke in enumerate(strokes, 1)]
    without = replace(make_capture(6), force=None, position=None)
    journal = recorded(tmp_path / "j", (*taps, without))
    with pytest.raises(CampaignError, match="2 shots are too few"):
        discrepancy(None, tmp_path / "out", journal=journal)
    said = capsys.readouterr().err
    assert "3 cycles with another stroke were left out" in said
    assert "1 cycles without samples were left out" in said


def test_an_export_has_what_the_cell_states_and_says_what_nobody_does(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    journal = recorded(tmp_path / "j", silent((make_capture(1), make_capture(2))))
    export(journal, tmp_path / "stated", cell=CELL)
    assert "stroke" not in capsys.readouterr().err
    back = campaigns.read(tmp_path / "stated")
    assert back.stroke_m == pytest.approx(1.5e-3)
    assert {one.mass_kg for one in back.shots} == {18.9}
    export(journal, tmp_path / "silent")
    assert "did not report its stroke" in capsys.readouterr().err
    assert math.isinf(campaigns.read(tmp_path / "silent").stroke_m)
