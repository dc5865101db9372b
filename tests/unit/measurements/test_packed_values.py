"""Values of HDF5 and Parquet files that are not as they stand: packed ones, durations, none at all."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from impactcell.cli.app import run_verb
from impactcell.errors import MeasurementError
from impactcell.measurements import read_tables
from impactcell.web.texts.import_faults import page_fault


def write_hdf5(path: Path, values: np.ndarray, **attributes: Any) -> Path:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    with h5py.File(path, "w") as file:
        file.create_dataset("time", data=1e-3 * np.arange(len(values))).attrs["units"] = "s"
        data = file.create_dataset("force", data=values)
        data.attrs.update({"units": "N", **attributes})
    return path


RAW = np.array([4, -999, 6, -1, 8], dtype=np.int16)
NAN = np.nan


@pytest.mark.parametrize(
    ("raw", "attributes", "values", "told"),
    [
        (RAW, {"scale_factor": 0.5}, [2, -499.5, 3, -0.5, 4], ", force by its scale_factor 0.5"),
        (RAW, {"add_offset": np.array([10.0])}, [14, -989, 16, 9, 18], ", force by its add_offset 10"),
        (
            RAW, {"scale_factor": np.float32(2), "add_offset": 1, "_FillValue": np.int16(-999)},
            [9, NAN, 13, -1, 17], ", force: 1 values left out by its _FillValue",
        ),
        (RAW, {"missing_value": np.array([-1, -999])}, [4, NAN, 6, NAN, 8], "2 values left out by"),
        (RAW.astype("f4") / np.float32(10), {"_FillValue": -99.9}, [0.4, NAN, 0.6, -0.1, 0.8], "1 values"),
        (RAW, {"_FillValue": np.int16(-5), "missing_value": "none"}, RAW, ""),
        (RAW, {}, RAW, ""),
    ],
)  # fmt: skip
def test_values_are_unpacked_as_the_cf_conventions_say(
    raw: np.ndarray, attributes: dict[str, Any], values: Any, told: str, tmp_path: Path
) -> None:
    (table,) = read_tables(write_hdf5(tmp_path / "a.h5", raw, **attributes))
    force = table.column("force")
    assert force is not None
    np.testing.assert_allclose(force.values, values, rtol=1e-6)
    assert told in table.notes[0]
    assert bool(told) or table.notes == ("HDF5",)


@pytest.mark.parametrize("scale", ["0.5 N", np.array([0.5, 2.0]), np.inf])
def test_a_scale_that_is_no_number_is_refused(scale: Any, tmp_path: Path) -> None:
    path = write_hdf5(tmp_path / "a.h5", RAW, scale_factor=scale)
    with pytest.raises(MeasurementError, match=r"/force: its scale_factor is '.*', where one num") as caught:
        read_tables(path)
    assert str(path) in str(caught.value)
    assert page_fault(str(caught.value), "de")[0] == "de"


def write_parquet(path: Path, **columns: Any) -> Path:
    pyarrow = pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    parquet.write_table(pyarrow.table(columns), path)
    return path


@pytest.mark.parametrize("options", [["--dry-run"], ["--dry-run", "--json"], ["-o", "out"]])
@pytest.mark.parametrize("beside_another", [True, False])
def test_a_file_without_rows_is_refused(beside_another: bool, options: list[str], tmp_path: Path) -> None:
    empty = write_parquet(tmp_path / "empty.parquet", time_s=np.zeros(0), force_n=np.zeros(0))
    good = write_parquet(tmp_path / "good.parquet", time_s=np.arange(9.0), position_m=np.arange(9.0) ** 2)
    files = [str(good), str(empty)] if beside_another else [str(empty)]
    options = [str(tmp_path / option) if option == "out" else option for option in options]
    with pytest.raises(MeasurementError, match=r"empty\.parquet: has no rows$") as caught:
        run_verb(["import", *files, *options])
    assert not (tmp_path / "out").exists()
    assert page_fault(str(caught.value), "de") == ("de", f"{empty}: hat keine Zeilen")


def test_durations_are_seconds(tmp_path: Path) -> None:
    durations = np.array([0, 100, 200], dtype="timedelta64[us]")
    path = write_parquet(tmp_path / "a.parquet", elapsed=durations, force_n=np.arange(3.0))
    (table,) = read_tables(path)
    assert [(column.name, column.unit) for column in table.columns] == [("elapsed", "s"), ("force", "N")]
    np.testing.assert_allclose(table.columns[0].values, [0.0, 1e-4, 2e-4], rtol=1e-12)


def test_a_file_of_a_duration_alone_lacks_the_rest(tmp_path: Path) -> None:
    durations = np.array([0, 100, "NaT"], dtype="timedelta64[ns]")
    path = write_parquet(tmp_path / "a.parquet", elapsed=durations)
    (table,) = read_tables(path)
    np.testing.assert_allclose(table.columns[0].values, [0.0, 1e-7, np.nan])
    with pytest.raises(MeasurementError, match="neither position nor force was found"):
        run_verb(["import", str(path), "--dry-run"])


def test_moments_count_from_the_first_that_is_there(tmp_path: Path) -> None:
    moments = np.array(["NaT", "2024-05-01T10:00:00.000", "2024-05-01T10:00:00.250"], dtype="datetime64[ms]")
    (table,) = read_tables(write_parquet(tmp_path / "a.parquet", time=moments))
    np.testing.assert_allclose(table.columns[0].values, [np.nan, 0.0, 0.25])
