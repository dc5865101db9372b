"""Binary files are read back exactly, and refused where they are too large, bombs or damaged."""

import gc
import gzip
import io
import json
import logging
import re
import sys
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from impactcell.errors import MeasurementError
from impactcell.measurements import ColumnMeaning, Limits, Table, guess, read_tables

Arrays = dict[str, np.ndarray]
UNITS = {"time": "s", "Force": "N", "Position": "mm"}


def write_parquet(path: Path, arrays: Arrays) -> None:
    pyarrow = pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    fields = [
        pyarrow.field(name, pyarrow.from_numpy_dtype(values.dtype), metadata={"unit": UNITS[name]})
        for name, values in arrays.items()
    ]
    parquet.write_table(pyarrow.table(list(arrays.values()), schema=pyarrow.schema(fields)), path)


def write_hdf5(path: Path, arrays: Arrays) -> None:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    with h5py.File(path, "w") as file:
        group = file.create_group("run 1")
        for name, values in arrays.items():
            group.create_dataset(name, data=values, compression="gzip").attrs["unit"] = UNITS[name]
        group.attrs["Masse"] = "18.9 kg"


def write_tdms(path: Path, arrays: Arrays) -> None:
    nptdms = pytest.importorskip("nptdms", reason="npTDMS is not installed")
    with nptdms.TdmsWriter(path) as writer:
        channels = [
            nptdms.ChannelObject("run 1", name, values, properties={"unit_string": UNITS[name]})
            for name, values in arrays.items()
        ]
        writer.write_segment(channels)


def write_mdf(path: Path, arrays: Arrays) -> None:
    asammdf = pytest.importorskip("asammdf", reason="asammdf is not installed")
    with asammdf.MDF(version="4.10") as file:
        signals = [
            asammdf.Signal(values, arrays["time"], unit=UNITS[name], name=name)
            for name, values in arrays.items()
            if name != "time"
        ]
        file.append(signals)
        file.save(path, overwrite=True)


def write_matlab(path: Path, arrays: Arrays) -> None:
    savemat(path, {"run": {**arrays, "units": UNITS}}, do_compression=True)


def write_matlab73(path: Path, arrays: Arrays) -> None:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in arrays.items():
            file.create_dataset(f"{name}_{UNITS[name]}", data=values[None, :])
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


WRITERS: dict[str, Callable[[Path, Arrays], None]] = {
    "a.parquet": write_parquet,
    "a.h5": write_hdf5,
    "a.tdms": write_tdms,
    "a.mf4": write_mdf,
    "a.mat": write_matlab,
    "a73.mat": write_matlab73,
}
every = pytest.mark.parametrize("name", WRITERS)


def arrays(count: int, seed: int = 0, dtype: str = "float64") -> Arrays:
    rng = np.random.default_rng(seed)
    return {
        "time": 1e-4 * np.arange(count),
        "Force": (100.0 * rng.normal(size=count)).astype(dtype),
        "Position": (100.0 * rng.normal(size=count)).astype(dtype),
    }


@pytest.mark.slow
@every
@given(
    count=st.integers(2, 300),
    seed=st.integers(0, 99),
    dtype=st.sampled_from(["float64", "float32", "int16", "int32"]),
)
@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_round_trip(name: str, count: int, seed: int, dtype: str, tmp_path: Path) -> None:
    path, written = tmp_path / name, arrays(count, seed, dtype)
    path.unlink(missing_ok=True)
    WRITERS[name](path, written)
    (table,) = read_tables(path)
    assert {column.name for column in table.columns} == set(written)
    for column in table.columns:
        assert column.unit == UNITS[column.name], column.name
        np.testing.assert_array_equal(column.values, written[column.name].astype(np.float64))
    mapping = guess([table])
    assert not mapping.faults
    assert {item.meaning for item in mapping.assignments} == {
        ColumnMeaning.TIME, ColumnMeaning.FORCE, ColumnMeaning.POSITION,
    }  # fmt: skip


@every
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_damaged_file_is_refused_or_read(name: str, data: st.DataObject, tmp_path: Path) -> None:
    path = tmp_path / name
    if not path.exists():
        WRITERS[name](path, arrays(200))
        (tmp_path / "whole").write_bytes(path.read_bytes())
    content = bytearray((tmp_path / "whole").read_bytes())
    for _ in range(data.draw(st.integers(0, 8))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(1, len(content)))
    damaged = tmp_path / f"damaged-{name}"
    damaged.write_bytes(content[:cut])
    small = Limits(cells=100_000, rows=100_000, file_bytes=10_000_000, unpacked_bytes=10_000_000)
    try:
        told = read_tables(damaged, small)[0].source
    except MeasurementError as error:
        told = str(error)
    assert str(damaged) in told


@pytest.mark.parametrize("kept", [8, 64, 100, 400, 1500])
@pytest.mark.filterwarnings("error::pytest.PytestUnraisableExceptionWarning")
def test_of_a_damaged_mdf_file_only_the_error_is_told(
    kept: int, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", told.append)
    path = tmp_path / "a.mf4"
    write_mdf(path, arrays(200))
    content = path.read_bytes()
    for damaged in (
        content[:kept],
        content[:kept] + bytes(len(content) - kept),
        b"MDF     3.30" + content[12:kept],
    ):
        path.write_bytes(damaged)
        with pytest.raises(MeasurementError, match=re.escape(str(path))):
            read_tables(path)
    gc.collect()
    assert told == []
    assert capfd.readouterr() == ("", "")
    assert path.resolve() not in [link.resolve() for link in Path("/proc/self/fd").iterdir()]


@every
def test_what_is_too_large_is_refused(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    WRITERS[name](path, arrays(5000))
    with pytest.raises(MeasurementError, match=r"more than the"):
        read_tables(path, Limits(cells=1000))
    with pytest.raises(MeasurementError, match=r"more than the"):
        read_tables(path, Limits(rows=1000))


def test_an_hdf5_file_that_claims_a_terabyte_is_refused_by_its_shape(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("Force", shape=(10**11,), dtype="f8", chunks=(10**6,), compression="gzip")
    assert path.stat().st_size < 10_000
    with pytest.raises(MeasurementError, match="100000000000 rows, more than"):
        read_tables(path)


def test_links_that_lead_out_of_a_file_are_not_followed(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py", reason="h5py is not installed")
    write_hdf5(tmp_path / "other.h5", arrays(20))
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["elsewhere"] = h5py.ExternalLink("other.h5", "/run 1")
        file["circle"] = h5py.SoftLink("/")
    with pytest.raises(MeasurementError, match="holds no column of numbers"):
        read_tables(tmp_path / "a.h5")


def bomb(size: int) -> bytes:
    return zlib.compress(b"\0" * size, 9)


@pytest.mark.slow
def test_bombs_are_refused_without_being_unpacked(tmp_path: Path) -> None:
    small = Limits(unpacked_bytes=20_000_000)
    zipped = io.BytesIO()
    with zipfile.ZipFile(zipped, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.csv", b"1;2\n" * 20_000_000)
    lying = zipped.getvalue().replace((80_000_000).to_bytes(4, "little"), (1000).to_bytes(4, "little"))
    matlab = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    inner = bomb(80_000_000)
    matlab += (15).to_bytes(4, "little") + len(inner).to_bytes(4, "little") + inner
    contents = {
        "a.zip": zipped.getvalue(),
        "b.zip": lying,
        "a.csv.gz": gzip.compress(b"1;2\n" * 20_000_000),
        "a.mat": matlab,
    }
    for name, content in contents.items():
        (tmp_path / name).write_bytes(content)
    tracemalloc.start()
    for name in contents:
        with pytest.raises(MeasurementError, match=r"a\.zip|b\.zip|a\.csv\.gz|a\.mat"):
            read_tables(tmp_path / name, small)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 60_000_000


@pytest.mark.parametrize(
    ("members", "told"),
    [
        ({"../../out.csv": b"1;2\n"}, "leads out of the archive"),
        ({"/etc/out.csv": b"1;2\n"}, "leads out of the archive"),
        ({"inner.zip": b"PK\x03\x04"}, "holds an archive"),
        ({"xl/workbook.xml": b"<x/>"}, "save its sheet as CSV"),
        ({f"{i}.csv": b"1;2\n" for i in range(20)}, "holds 20 files, more than the 10"),
        ({"bad.csv": b"t;F\n1;2\n"}, "a.zip/bad.csv"),
        ({}, "holds no files"),
    ],
)
def test_archives_that_are_refused(tmp_path: Path, members: dict[str, bytes], told: str) -> None:
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    if "bad.csv" in members:
        members["bad.csv"] = b"no numbers"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("bad.csv", b"no numbers\nhere\n")
    with pytest.raises(MeasurementError, match=told.replace(".", r"\.")):
        read_tables(path, Limits(files=10))


def test_files_of_an_archive_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w") as archive:
        for number in (10, 9, 1):
            rows = "".join(f"{i};{number}\n" for i in range(20))
            archive.writestr(f"runs/shot{number}.csv", f"t [s];F [N]\n{rows}")
    tables: tuple[Table, ...] = read_tables(path)
    assert [table.columns[1].values[0] for table in tables] == [1.0, 9.0, 10.0]
    assert tables[0].source.endswith("a.zip/runs/shot1.csv")


def test_a_missing_reader_is_told_with_the_way_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.parquet"
    path.write_bytes(b"PAR1" + bytes(20) + b"PAR1")
    monkeypatch.setitem(__import__("sys").modules, "pyarrow.parquet", None)
    with pytest.raises(
        MeasurementError, match=r"run `\.venv/bin/pip install -e '\.\[import\]'` in the checkout, or"
    ):
        read_tables(path)


def test_cell_arrays_of_matlab_are_a_table_each(tmp_path: Path) -> None:
    runs = [arrays(40 + 10 * n, seed=n) for n in range(3)]
    times, values = np.empty(3, dtype=object), np.empty(3, dtype=object)
    for n, run in enumerate(runs):
        times[n], values[n] = run["time"], np.stack([run["Force"], run["Position"]])
    savemat(tmp_path / "a.mat", {"Time": times, "Y": values, "dt": 1e-4})
    tables = read_tables(tmp_path / "a.mat")
    assert [len(table) for table in tables] == [40, 50, 60]
    for table, run in zip(tables, runs, strict=True):
        assert [column.name for column in table.columns] == ["Time", "Y 1", "Y 2"]
        np.testing.assert_array_equal(table.columns[2].values, run["Position"])


def test_json_logs_are_read(tmp_path: Path) -> None:
    log = tmp_path / "log.json"
    entries = [
        {"timestamp_s": 0.01 * i, "load": i, "on": i > 3, "gone": None if i else 1.0} for i in range(20)
    ]
    log.write_text(json.dumps({"mass": 0.49, "entries": entries}), encoding="utf-8")
    (table,) = read_tables(log)
    assert table.attributes["mass"] == "0.49"
    assert [(c.name, c.unit) for c in table.columns][:2] == [("timestamp", "s"), ("load", None)]
    assert np.isnan(table.columns[3].values[1:]).all()
    log.write_text(json.dumps({"t_s": [0.0, 1.0], "F_n": [2.0, 3.0]}), encoding="utf-8")
    assert [(c.name, c.unit) for c in read_tables(log)[0].columns] == [("t", "s"), ("F", "N")]
    for text, told in (
        ("{\n nonsense}", ":2: is not JSON"),
        ("{}", "holds no list"),
        ("[" * 100_000, "log.json"),
    ):
        log.write_text(text, encoding="utf-8")
        with pytest.raises(MeasurementError, match=told):
            read_tables(log)


def test_a_tdms_file_that_ends_within_a_segment_is_told(tmp_path: Path) -> None:
    file = tmp_path / "a.tdms"
    write_tdms(file, arrays(200))
    (table,) = read_tables(file)
    assert table.notes == ("TDMS group run 1",)
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) - 100])
    assert all("cut off: what follows" in table.notes[0] for table in read_tables(file))


def test_what_a_library_logs_of_a_file_does_not_stand_beside_our_message(tmp_path: Path) -> None:
    write_mdf(tmp_path / "a.mf4", arrays(50))
    read_tables(tmp_path / "a.mf4")
    assert not logging.getLogger("asammdf").isEnabledFor(logging.ERROR)
