"""Several taps in one record, before each of which the part is put back to where it began."""

import json
from pathlib import Path

import numpy as np
import pytest

from impactcell.cli.app import run_verb
from impactcell.measurements import Given, guess, make_campaign
from impactcell.web.texts.import_notes import page_note
from tests.taps import Tap
from tests.unit.measurements.records import PLACE_M, RATE_HZ, recorded

BEFORE_S = 0.03
"""Time from where the part lies in its place again to contact: less than is kept of a record before it."""
TAP = Tap(2500 / 6e4, 0.2, stroke_m=1.5e-3, effects={})


def record(count: int) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(8)
    motion = TAP.motion()
    since = np.arange(-BEFORE_S, 0.6, 1.0 / RATE_HZ) - 0.5 / RATE_HZ
    force = np.where(since > 0.0, motion.force_n(np.maximum(since, 0.0)), 0.0)
    position = np.where(since > 0.0, motion.position_m(np.maximum(since, 0.0)), 0.0)
    noise = rng.normal(size=(2, count * since.size))
    time = np.arange(count * since.size) / RATE_HZ
    return (
        time,
        np.tile(force, count) + 0.4 * noise[0],
        PLACE_M + np.tile(position, count) + 1.5e-6 * noise[1],
    )


def test_a_part_starts_where_it_lies_before_contact() -> None:
    """The mean over what is kept before contact was half a slide away."""
    table = recorded("data/a.csv", record(4))
    constants = {"mass": 18.9, "velocity": TAP.velocity_m_s, "stroke": 1.5e-3}
    found = make_campaign([table], guess([table], Given(constants=constants)))
    assert len(found.campaign.shots) == 4
    for shot in found.campaign.shots:
        assert shot.start_m == pytest.approx(PLACE_M, abs=1e-6)
    assert not any("springs back" in note for note in found.notes)
    note = "positions left out of before the part was put to where it is struck, in 3 taps"
    assert note in found.notes
    german = "weggelassene Positionen von vor dem Zurücklegen des Teils (Stöße: 3)"
    assert page_note(note, "de") == ("de", german)


def test_nothing_is_foretold_to_be_refused_that_is_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "long.csv"
    time, force, position = record(4)
    np.savetxt(
        file, np.column_stack([time, force, 1e3 * position]), delimiter=";", fmt="%.6f",
        header="time [s];force [N];position [mm]", comments="",
    )  # fmt: skip
    said = [
        item for name in ("mass=18.9kg", "velocity=2500mm/min", "stroke=1.5mm") for item in ("--set", name)
    ]
    with pytest.raises(SystemExit) as ended:
        run_verb(["import", str(file), "--dry-run", "--json", *said])
    assert ended.value.code == 0
    assert not any("refused" in note for note in json.loads(capsys.readouterr().out)["notes"])
