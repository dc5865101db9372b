"""`impactcell estimate`, then `impactcell track`, beside the service on the same taps."""

import json
from pathlib import Path

import numpy as np
import pytest

import impactcell
from impactcell import cell as core
from impactcell.cli.estimate import estimate
from impactcell.cli.estimate_columns import COLUMNS
from impactcell.cli.track import track
from impactcell.errors import SeriesError
from impactcell.records import PositioningState
from impactcell.service.factory import cell_design
from impactcell.settings import read_cell
from tests.taps import Tap
from tests.unit.cli.test_estimate import PROTOTYPE, campaign, rows

MU_S, LEVEL_ERROR, OWN_STD = 0.2, 0.0025, 0.0005


@pytest.mark.slow
def test_the_level_of_estimates_shares_what_the_service_says_that_taps_share(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """mu_k/mu_s is 3 % below the model's: what all taps share says so, here as there."""
    design, draw = cell_design(read_cell(PROTOTYPE)), np.random.default_rng(4)
    state, ratio = core.initial_state(design), 0.97 * design.model.ratio
    taps = [Tap(0.05, MU_S, ratio=ratio, stroke_m=1.5e-3).capture(draw, cycle=n) for n in range(1, 21)]
    for tap in taps:
        stepped = core.step(design, state, tap, PositioningState(), None, ())
        state = stepped.state
    estimate(campaign(tmp_path / "c", taps), PROTOTYPE, tmp_path / "s.csv")
    for row in rows(tmp_path / "s.csv"):
        assert 0.5 * float(row["mu_s_std"]) < float(row["mu_s_common_std"]) <= float(row["mu_s_std"])
    capsys.readouterr()
    track(tmp_path / "s.csv", as_json=True)
    found, wear = json.loads(capsys.readouterr().out), stepped.snapshot.wear
    assert found["level_common_std"] == pytest.approx(wear.level_common_std, rel=0.05)
    assert found["level"] == pytest.approx(wear.level, rel=2e-3)
    off = abs(found["level"] - MU_S)
    assert off > 4.0 * found["level_std"]
    assert off < 2.5 * np.hypot(found["level_std"], found["level_common_std"])


def of_one_error(seed: int, path: Path) -> Path:
    """300 cycles of a level that does not change, all of them off by one error."""
    draw = np.random.default_rng(seed)
    seen = MU_S + LEVEL_ERROR * draw.normal() + OWN_STD * draw.normal(size=300)
    std = float(np.hypot(LEVEL_ERROR, OWN_STD))
    lines = [f"{cycle},{value:.7f},{std:.7f},{LEVEL_ERROR}" for cycle, value in enumerate(seen)]
    path.write_text("cycle,mu_s,mu_s_std,mu_s_common_std\n" + "\n".join(lines) + "\n")
    return path


@pytest.mark.slow
def test_an_error_of_all_cycles_is_in_what_is_told_of_the_level(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    held = 0
    for seed in range(20):
        track(of_one_error(seed, tmp_path / "s.csv"), as_json=True)
        found = json.loads(capsys.readouterr().out)
        off = abs(found["level"] - MU_S)
        held += off < 2.0 * np.hypot(found["level_std"], found["level_common_std"])
    assert held >= 17


def test_columns_that_estimate_writes_are_no_surprise_to_track(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Fifteen of them were named on each run, between which a misspelled one is not seen."""
    path = tmp_path / "s.csv"
    lines = [",".join(COLUMNS)]
    for shot in range(1, 31):
        cells = dict.fromkeys(COLUMNS, "") | {"shot": f"{shot}", "mu_s": "0.2", "mu_s_std": "0.002"}
        lines.append(",".join(cells[name] for name in COLUMNS))
    path.write_text("\n".join(lines))
    track(path)
    assert capsys.readouterr().err == ""
    path.write_text("\n".join(f"{line},charge" for line in lines))
    track(path)
    assert "not read: `charge`; what is read" in capsys.readouterr().err


def test_what_all_cycles_share_is_said_where_it_is_known(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = of_one_error(1, tmp_path / "s.csv")
    track(path)
    told = capsys.readouterr()
    assert "common  ± 0.00500 more: mu_s may be off by that in all cycles alike" in told.out
    assert told.err == ""
    table = np.loadtxt(path, delimiter=",", skiprows=1).T
    series = impactcell.track(*table[:3], mu_s_common_std=table[3])
    assert series.wear.level_common_std == pytest.approx(LEVEL_ERROR)
    assert impactcell.track(*table[:3], mu_s_common_std=LEVEL_ERROR).wear == series.wear
    with pytest.raises(SeriesError, match="mu_s_common_std must be as long as cycle"):
        impactcell.track(*table[:3], mu_s_common_std=table[3, 1:])
    path.write_text("\n".join(line.rpartition(",")[0] for line in path.read_text().splitlines()) + "\n")
    track(path)
    assert "common" not in capsys.readouterr().out
    track(path, as_json=True)
    assert json.loads(capsys.readouterr().out)["level_common_std"] is None
