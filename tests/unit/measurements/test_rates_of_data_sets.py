"""HDF5 files whose data sets say their rates themselves, as those of several devices do."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from impactcell.measurements import guess, make_campaign, read_tables
from impactcell.measurements.given import read_given
from impactcell.records import Capture
from tests.unit.measurements.records import PRETRIGGER_S, sampled, taps

TAP = taps((3000,), (18.9,))[0]


def imported(path: Path, force: dict[str, Any], position: dict[str, Any], every: int = 1) -> Capture:
    """Give the tap of a file without times; only every n-th sample of the position is in it."""
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    _, force_n, position_m = sampled(TAP, np.random.default_rng(2))
    with h5py.File(path, "w") as file:
        group = file.create_group("shot 1")
        group.attrs.update({"mass": "18.9 kg", "velocity": "3000 mm/min"})
        for name, values, unit, said in (
            ("force", force_n, "N", force),
            ("position", position_m[::every], "m", position),
        ):
            group.create_dataset(name, data=values).attrs.update({"unit": unit, **said})
    tables = read_tables(path)
    (shot,) = make_campaign(tables, guess(tables, read_given({"constants": ["stroke=1.5mm"]}))).campaign.shots
    return shot


def steps_of(shot: Capture) -> list[float]:
    found = []
    for channel in (shot.force, shot.position):
        assert channel is not None
        found.append(float(np.median(np.diff(channel.time_s))))
        assert channel.time_s[0] == pytest.approx(-PRETRIGGER_S, abs=2e-4)
    return found


@pytest.mark.parametrize(
    "said",
    [{"sample_rate": 10_000}, {"wf_increment": 1e-4}, {"Sampling Rate [kHz]": 10.0}, {"dt": "0.1 ms"}],
)
def test_a_rate_that_each_data_set_says_is_read(tmp_path: Path, said: dict[str, Any]) -> None:
    assert steps_of(imported(tmp_path / "a.h5", said, said)) == pytest.approx([1e-4, 1e-4])
    assert steps_of(imported(tmp_path / "b.h5", said, {})) == pytest.approx([1e-4, 1e-4])


def test_data_sets_have_a_rate_each(tmp_path: Path) -> None:
    slower = {"sample_rate": "5 kHz"}
    found = imported(tmp_path / "a.h5", {"sample_rate": 10_000}, slower, every=2)
    assert steps_of(found) == pytest.approx([1e-4, 2e-4])
    path = tmp_path / "b.h5"  # of one length, too, as where recorders have buffers of one size
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    _, force_n, position_m = sampled(TAP, np.random.default_rng(2), tail_s=0.3)
    half = len(position_m[::2])
    with h5py.File(path, "w") as file:
        for name, values, unit, rate in (
            ("force", force_n[:half], "N", 10_000),
            ("position", position_m[::2], "m", 5_000),
        ):
            file.create_dataset(name, data=values).attrs.update({"unit": unit, "fs": rate})
    tables = read_tables(path)
    given = read_given({"constants": ["mass=18.9kg", "velocity=3000mm/min", "stroke=1.5mm"]})
    (shot,) = make_campaign(tables, guess(tables, given)).campaign.shots
    assert steps_of(shot) == pytest.approx([1e-4, 2e-4])
