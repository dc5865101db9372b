"""Vectors of a file beside its channels: constants, lists of shots, text, and what is none of these."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from impactcell.errors import MeasurementError
from impactcell.measurements import guess, make_campaign, read_tables
from impactcell.measurements.given import read_given
from impactcell.records import Capture

Arrays = dict[str, np.ndarray]
Parts = dict[str, np.ndarray | str]


def write_parts(path: Path, groups: dict[str, Parts]) -> None:
    """An HDF5 file of these groups; what is a text is written as MATLAB writes its characters."""
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    with h5py.File(path, "w") as file:
        for group, items in groups.items():
            for name, values in items.items():
                if not isinstance(values, str):
                    file.create_dataset(f"{group}/{name}", data=values)
                    continue
                codes = np.array([[ord(sign)] for sign in values], dtype=np.uint16)
                file.create_dataset(f"{group}/{name}", data=codes).attrs["MATLAB_class"] = np.bytes_("char")


def slide(speed: float = 0.2) -> Arrays:
    of = np.arange(2000) * 1e-4
    since = np.minimum(of, speed / 1.5)
    return {"time_s": of, "position_m": speed * since - 0.75 * since**2}


def slides(path: Path, *said: str) -> list[Capture]:
    tables = read_tables(path)
    given = read_given({"constants": list(said)}, excitation="free_slide")
    return list(make_campaign(tables, guess(tables, given)).campaign.shots)


def test_what_stands_beside_the_channels_needs_no_time(tmp_path: Path) -> None:
    """A vector of three numbers of calibration made a file one without a time."""
    path = tmp_path / "a.h5"
    write_parts(
        path, {"/": {**slide(), "calibration": np.array([1.0, 2.0, 4.5]), "mass_kg": np.array([2.5])}}
    )
    (shot,) = slides(path)
    assert (shot.mass_kg, shot.covariates) == (2.5, {"calibration": 2.5})
    (fault,) = guess(read_tables(path), read_given({"constants": ["rate=10kHz"]})).faults
    assert "the times are those of column 'time', so that the rate has no use" in fault
    values = {name.replace("_s", "").replace("_m", ""): of for name, of in slide().items()}
    calibration = {"calibration": np.array([1.0, 2.0, 4.5]), "count": np.array([1.0, 2.0, 3.0])}
    savemat(tmp_path / "a.mat", {**values, **calibration})
    tables = read_tables(tmp_path / "a.mat")
    mapping = guess(tables, read_given({"units": ["time=s", "position=m"], "constants": ["mass=2kg"]}))
    (shot,) = make_campaign(tables, mapping).campaign.shots
    assert shot.covariates == {"calibration": 2.5}


def test_what_stands_beside_the_channels_is_of_the_records_of_its_group(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    groups: dict[str, Parts] = {f"run/{n}": slide(0.1 * n) for n in (1, 2, 3)}
    groups["run/2"]["oil_k"] = np.array([300.0, 302.0])
    groups["run"] = {"mass_kg": np.array([2.5])}
    groups["other"] = slide(0.4)
    groups["other"]["mass_kg"] = np.array([3.5])
    write_parts(path, groups)
    shots = slides(path)
    assert [shot.mass_kg for shot in shots] == [3.5, 2.5, 2.5, 2.5]
    assert [shot.covariates for shot in shots] == [{}, {}, {"oil_k": 301.0}, {}]


def test_a_list_of_shots_beside_the_channels_is_of_those_shots(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    of = [slide(0.1), slide(0.2)]
    long: Parts = {name: np.concatenate([of[0][name], of[1][name]]) for name in of[0]}
    listed = {"shot": np.array([8.0, 7.0]), "mass_kg": np.array([8.5, 7.5])}
    write_parts(path, {"/": {**long, "shot": np.repeat([7.0, 8.0], 2000)}, "list": listed})
    assert [(shot.cycle, shot.mass_kg) for shot in slides(path)] == [(7, 7.5), (8, 8.5)]
    write_parts(path, {"1": of[0], "2": of[1], "list": listed})
    with pytest.raises(MeasurementError, match=r"is 7.5 kg and 8.5 kg within one record"):
        slides(path)


def test_a_table_after_each_record_tells_of_that_one(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    groups: dict[str, Parts] = {}
    for number in (1, 2):
        groups[f"run{number}_data"] = slide(0.1 * number)
        groups[f"run{number}_set"] = {"mass_kg": np.array([2.5 * number])}
    write_parts(path, groups)
    assert [shot.mass_kg for shot in slides(path)] == [2.5, 5.0]


def test_text_and_empty_arrays_of_matlab_are_no_numbers(tmp_path: Path) -> None:
    """Characters are stored as numbers, and so is the shape of what is empty."""
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    path = tmp_path / "a.h5"
    write_parts(path, {"/": {**slide(), "material": "PTFE"}})
    with h5py.File(path, "a") as file:
        file.create_dataset("nothing", data=np.zeros(2, dtype=np.uint64)).attrs["MATLAB_empty"] = 1
    (shot,) = slides(path)
    assert shot.batch_id == "PTFE"
    assert shot.covariates == {}


def test_references_and_lists_in_an_hdf5_file_are_passed_over(tmp_path: Path) -> None:
    """A cell array of MATLAB beside the channels made a file a damaged one."""
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    path = tmp_path / "a.h5"
    write_parts(path, {"/": slide()})
    with h5py.File(path, "a") as file:
        cells = file.create_dataset("cells", (2, 1), dtype=h5py.ref_dtype)
        cells[:, 0] = file["position_m"].ref
        lists = file.create_dataset("lists", (2,), dtype=h5py.vlen_dtype(np.float64))
        lists[0], lists[1] = np.arange(3.0), np.arange(4.0)
        file.create_dataset("words", data=np.array(["a", "a"], dtype=object), dtype=h5py.string_dtype())
    assert [shot.covariates for shot in slides(path)] == [{"words": "a"}]
