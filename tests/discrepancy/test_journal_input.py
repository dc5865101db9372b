"""The discrepancy workflow on a journal: what its module does not report, and what is left out."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from impactcell import campaign as campaigns
from impactcell.cli.discrepancy import discrepancy
from impactcell.cli.export import export
from impactcell.errors import CampaignError, JournalError
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


@pytest.mark.slow
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


def test_the_noise_that_a_cell_states_counts_and_its_guess_does_not(tmp_path: Path) -> None:
    """The report said that it was not stated, and estimated it."""
    captures = (make_capture(1), make_capture(2))
    quiet = [
        replace(one, **{name: replace(getattr(one, name), noise_std=None) for name in ("force", "position")})
        for one in captures
    ]
    journal = recorded(tmp_path / "j", tuple(quiet))
    export(journal, tmp_path / "stated", cell=CELL)
    sensors = campaigns.read(tmp_path / "stated").sensors
    assert (sensors["force"].noise_std, sensors["position"].noise_std) == (0.4, pytest.approx(1.5e-6))
    text = CELL.read_text(encoding="utf-8").replace("../", f"{CELL.parents[1].absolute()}/")
    for key in ("force_noise_std_n: 0.4", "position_noise_std_um: 1.5"):
        assert f"  {key}\n" in text
        text = text.replace(f"  {key}\n", "").replace("sensors:\n", "")
    (tmp_path / "cell.yaml").write_text(text, encoding="utf-8")
    export(journal, tmp_path / "silent", cell=tmp_path / "cell.yaml")
    sensors = campaigns.read(tmp_path / "silent").sensors
    assert sensors["force"].noise_std is sensors["position"].noise_std is None


def test_the_journal_of_another_cell_is_refused(tmp_path: Path) -> None:
    """Its stroke and mass were taken for those of the cell that was named."""
    with Journal(tmp_path / "j", "press-1") as journal:
        journal.append(make_capture(1), make_snapshot(make_capture(1)), b"state")
    said = "the journal of cell 'press-1', not of 'prototype'"
    with pytest.raises(JournalError, match=said):
        export(tmp_path / "j", tmp_path / "campaign", cell=CELL)
    with pytest.raises(JournalError, match=said):
        discrepancy(None, tmp_path / "out", journal=tmp_path / "j", cell=CELL)
    assert not (tmp_path / "campaign").exists()


@pytest.mark.parametrize(
    ("first", "last", "said"),
    [
        (3, 1, "--first-cycle 3 is above --last-cycle 1: put them the other way round"),
        (9, None, "of cycles from 9 there are no samples: the journal has samples of cycles 1 to 2"),
        (None, 0, "of cycles to 0 there are no samples: the journal has samples of cycles 1 to 2"),
    ],
)
def test_a_range_without_cycles_is_told_which_there_are(
    tmp_path: Path, first: int | None, last: int | None, said: str
) -> None:
    journal = recorded(tmp_path / "j", (make_capture(1), make_capture(2)))
    with pytest.raises(CampaignError, match=said):
        export(journal, tmp_path / "campaign", first_cycle=first, last_cycle=last)
