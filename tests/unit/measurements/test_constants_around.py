"""What a file says around its records: attributes and scalars of the groups and structures they stand in."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from impactcell.errors import MeasurementError
from impactcell.measurements import guess, make_campaign, read_tables
from impactcell.measurements.given import read_given
from impactcell.records import Capture
from tests.unit.measurements.records import sampled, taps

Tree = dict[str, object]


def record(velocity_mm_per_min: int, prefix: str = "") -> dict[str, np.ndarray]:
    """A tap, with the units in the names."""
    tap = taps((velocity_mm_per_min,), (18.9,))[0]
    values = sampled(tap, np.random.default_rng(velocity_mm_per_min))
    return dict(zip((f"{prefix}time_s", f"{prefix}force_N", f"{prefix}position_m"), values, strict=True))


def write_groups(path: Path, attributes: dict[str, Tree], data: dict[str, dict[str, np.ndarray]]) -> None:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    with h5py.File(path, "w") as file:
        for group, arrays in data.items():
            for name, values in arrays.items():
                file.create_dataset(f"{group}/{name}", data=values)
        for group, said in attributes.items():
            file.require_group(group).attrs.update(said)


def shots(path: Path) -> list[Capture]:
    tables = read_tables(path)
    given = read_given({"constants": ["stroke=1.5mm"]})
    return list(make_campaign(tables, guess(tables, given)).campaign.shots)


def told(found: list[Capture]) -> list[tuple[float, float, str | None]]:
    return [(round(shot.mass_kg, 9), round(6e4 * shot.velocity_m_s, 6), shot.batch_id) for shot in found]


def test_attributes_around_a_group_hold_for_it_unless_it_says_otherwise(tmp_path: Path) -> None:
    """They were dropped: taps had no mass, all of them one velocity, or none."""
    path = tmp_path / "a.h5"
    groups: dict[str, Tree] = {
        "/": {"mass": "18.9 kg", "velocity": "3000 mm/min"},
        "shot1": {"batch": "B1"},
        "shot2": {"batch": "B2", "velocity": "4000 mm/min"},
    }
    write_groups(path, groups, {"shot1/daq": record(3000), "shot2/daq": record(4000)})
    assert told(shots(path)) == [(18.9, 3000.0, "B1"), (18.9, 4000.0, "B2")]


def test_scalars_of_a_group_are_said_with_their_unit(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    path = tmp_path / "a.h5"
    write_groups(path, {}, {"run/1": record(3000), "run/2": record(4000)})
    with h5py.File(path, "a") as file:
        file.create_dataset("run/mass", data=18900.0).attrs["unit"] = "g"
        for number, velocity in ((1, 3000), (2, 4000)):
            file.create_dataset(f"run/{number}/velocity", data=f"{velocity} mm/min")
    assert told(shots(path)) == [(18.9, 3000.0, None), (18.9, 4000.0, None)]


def test_scalars_of_a_structure_beside_the_vectors_are_of_the_record(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    savemat(path, {"data": record(3000), "meta": {"mass_kg": 18.9, "velocity_mm_min": 3000.0, "batch": "B1"}})
    assert told(shots(path)) == [(18.9, 3000.0, "B1")]


def test_scalars_around_structures_hold_for_all_of_them(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    runs = [
        {"data": record(velocity), "set": {"velocity_mm_min": float(velocity)}} for velocity in (3000, 4000)
    ]
    savemat(path, {"run": np.array(runs, dtype=object), "mass": 18900.0, "units": {"mass": "g"}})
    assert told(shots(path)) == [(18.9, 3000.0, None), (18.9, 4000.0, None)]


def test_scalars_of_one_name_in_several_structures_are_told_apart(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    said = {"part": {"mass_kg": 18.9}, "gripper": {"mass_kg": 2.0}, "velocity_mm_min": 3000.0}
    savemat(path, {"data": record(3000), **said})
    assert told(shots(path)) == [(18.9, 3000.0, None)]
    savemat(
        path, {"data": record(3000), "a": {"mass_kg": 18.9}, "b": {"mass_kg": 2.0}, "velocity_mm_min": 3e3}
    )
    with pytest.raises(MeasurementError, match=r"say mass 18.9 kg and 2 kg"):
        shots(path)


def test_how_a_velocity_is_said_is_told_by_the_kind_of_file(tmp_path: Path) -> None:
    """It was "in a line above the table", which these files have not."""
    write_groups(tmp_path / "a.h5", {"/": {"mass": "18.9 kg"}}, {"1": record(3000)})
    savemat(tmp_path / "a.mat", record(3000))
    time, force, position = record(3000).values()
    rows = [f"{t},{f},{x}" for t, f, x in zip(time, force, position, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(["time [s],force [N],position [m]", *rows]), encoding="utf-8")
    for name, way in (
        ("a.h5", "an attribute of its group or of the file, velocity = '3000 mm/min'"),
        ("a.mat", "a scalar, velocity_mm_min = 3000"),
        ("a.csv", "'velocity: 3000 mm/min' in a line above the table"),
    ):
        with pytest.raises(MeasurementError) as raised:
            shots(tmp_path / name)
        assert f"write it as {way}, or give --set" in str(raised.value)
