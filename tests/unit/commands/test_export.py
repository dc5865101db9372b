"""A campaign exported from a journal reads back as what was recorded."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from impactcell import campaign
from impactcell.campaign.recorded import from_captures
from impactcell.commands.export import export
from impactcell.errors import CampaignError
from impactcell.journal.store import Journal
from impactcell.records import Capture
from tests.snapshots import make_capture, make_snapshot


def fill(path: Path, captures: list[Capture]) -> None:
    with Journal(path, "press-1") as journal:
        for capture in captures:
            journal.append(capture, make_snapshot(capture), b"state")


def test_round_trip(tmp_path: Path) -> None:
    captures = [replace(make_capture(cycle), stroke_m=1.5e-3) for cycle in range(1, 6)]
    fill(tmp_path / "j", captures)
    export(tmp_path / "j", tmp_path / "campaign", first_cycle=2, last_cycle=4)
    back = campaign.read(tmp_path / "campaign")
    assert [shot.cycle for shot in back.shots] == [2, 3, 4]
    assert back.stroke_m == 1.5e-3
    for was, now in zip(captures[1:4], back.shots, strict=True):
        assert was.force is not None
        assert now.force is not None
        np.testing.assert_allclose(now.force.values, was.force.values, atol=1e-9)
        assert now.batch_id == was.batch_id
        assert now.velocity_m_s == pytest.approx(was.velocity_m_s)


def test_repeated_cycle_numbers_are_counted_anew(tmp_path: Path) -> None:
    fill(tmp_path / "j", [make_capture(1, session=1), make_capture(1, session=2)])
    export(tmp_path / "j", tmp_path / "campaign")
    back = campaign.read(tmp_path / "campaign")
    assert [(s.cycle, s.covariates["session"], s.covariates["cycle"]) for s in back.shots] == [
        (1, 1, 1),
        (2, 2, 1),
    ]


def test_cycles_of_another_stroke_are_counted_out(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    strokes = [1e-3, 1e-3, 2e-3]
    captures = [replace(make_capture(i), stroke_m=s) for i, s in enumerate(strokes, 1)]
    assert from_captures(captures).other_stroke == 1
    fill(tmp_path / "j", captures)
    export(tmp_path / "j", tmp_path / "campaign")
    assert "1 cycles with another stroke were left out" in capsys.readouterr().err


def test_nothing_to_export_is_said(tmp_path: Path) -> None:
    fill(tmp_path / "j", [])
    with pytest.raises(CampaignError, match="no capture"):
        export(tmp_path / "j", tmp_path / "campaign")
    assert not (tmp_path / "campaign").exists()
