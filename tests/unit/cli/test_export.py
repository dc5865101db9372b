"""A campaign exported from a journal reads back as what was recorded."""

import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from impactcell import campaign
from impactcell.campaign.recorded_campaign import from_captures
from impactcell.cli.export import export
from impactcell.errors import CampaignError
from impactcell.journal.store import Journal
from impactcell.records import Capture
from tests.snapshots import make_capture, make_snapshot


def fill(path: Path, captures: list[Capture]) -> None:
    with Journal(path, "press-1") as journal:
        for capture in captures:
            journal.append(capture, make_snapshot(capture), b"state")


def test_round_trip(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    captures = [replace(make_capture(cycle), stroke_m=1.5e-3) for cycle in range(1, 6)]
    fill(tmp_path / "j", captures)
    export(tmp_path / "j", tmp_path / "campaign", first_cycle=2, last_cycle=4)
    assert capsys.readouterr().err == ""
    back = campaign.read(tmp_path / "campaign")
    assert [shot.cycle for shot in back.shots] == [2, 3, 4]
    assert back.stroke_m == 1.5e-3
    for was, now in zip(captures[1:4], back.shots, strict=True):
        assert was.force is not None
        assert now.force is not None
        np.testing.assert_allclose(now.force.values, was.force.values, atol=1e-9)
        assert now.batch_id == was.batch_id
        assert now.velocity_m_s == pytest.approx(was.velocity_m_s)


def test_a_batch_that_a_person_named_is_exported(tmp_path: Path) -> None:
    """A module that says nothing of batches left the column empty, whatever StartBatch had said."""
    silent = [replace(make_capture(cycle), batch_id=None) for cycle in (1, 2, 3)]
    with Journal(tmp_path / "j", "press-1") as journal:
        for capture, batch_id in zip(silent, ("", "lot 17", "lot 17"), strict=True):
            snapshot = make_snapshot(capture)
            journal.append(
                capture, replace(snapshot, batch=replace(snapshot.batch, batch_id=batch_id)), b"state"
            )
    export(tmp_path / "j", tmp_path / "campaign")
    back = campaign.read(tmp_path / "campaign")
    assert [shot.batch_id for shot in back.shots] == [None, "lot 17", "lot 17"]


def test_repeated_cycle_numbers_are_counted_anew(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fill(tmp_path / "j", [make_capture(1, session=1), make_capture(1, session=2)])
    export(tmp_path / "j", tmp_path / "campaign")
    assert "the module restarted meanwhile: cycles of 2 sessions" in capsys.readouterr().err
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


IN_A_READ_ONLY_PLACE = """
mount --bind "$1" "$1" && mount -o remount,bind,ro "$1" || exit 77
shift
exec "$@"
"""


@pytest.mark.slow
@pytest.mark.parametrize("log", [False, True])
def test_a_read_only_medium(tmp_path: Path, log: bool) -> None:
    place, copy = tmp_path / "place", tmp_path / "place" / "copy"
    place.mkdir()
    fill(tmp_path / "j", [make_capture(1)])
    with Journal(tmp_path / "j", "press-1") as journal:  # as a power cut leaves it
        journal.append(make_capture(2), make_snapshot(make_capture(2)), b"state")
        for name in ("j", "j-wal") if log else ("j",):
            shutil.copy(tmp_path / name, copy.with_name(name.replace("j", "copy")))
    verb = [sys.executable, "-m", "impactcell", "export", str(copy), "-o", str(tmp_path / "campaign")]
    namespace = ["unshare", "--map-root-user", "--mount", "sh", "-c", IN_A_READ_ONLY_PLACE, "sh", str(place)]
    try:
        done = subprocess.run([*namespace, *verb], capture_output=True, text=True, check=False)
    except FileNotFoundError:
        pytest.skip("there is no unshare here to make a medium read-only with")
    if done.returncode == 77 or done.stderr.startswith("unshare:"):
        pytest.skip(f"no medium can be made read-only here: {done.stderr.strip()}")
    if log:
        assert done.returncode == 1
        assert "copy it, with copy-wal where there is one, to a directory that can be written" in done.stderr
    else:
        assert done.returncode == 0, done.stderr
        assert [shot.cycle for shot in campaign.read(tmp_path / "campaign").shots] == [1]


def test_a_log_is_never_left_unread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where the medium is read-only for us, but not for the service."""
    fill(tmp_path / "j", [make_capture(1)])
    read_only = os.statvfs_result((*os.statvfs(tmp_path)[:8], os.ST_RDONLY, 255))
    monkeypatch.setattr("impactcell.journal.database.os.statvfs", lambda _: read_only)
    with Journal(tmp_path / "j", None, read_only=True) as reader:
        assert not (tmp_path / "j-shm").exists()
        assert reader.count() == 1
    with Journal(tmp_path / "j", "press-1") as journal:
        journal.append(make_capture(2), make_snapshot(make_capture(2)), b"state")
        with Journal(tmp_path / "j", None, read_only=True) as reader:
            assert reader.count() == 2


def test_nothing_to_export_is_said(tmp_path: Path) -> None:
    fill(tmp_path / "j", [])
    with pytest.raises(CampaignError, match="no capture"):
        export(tmp_path / "j", tmp_path / "campaign")
    assert not (tmp_path / "campaign").exists()
